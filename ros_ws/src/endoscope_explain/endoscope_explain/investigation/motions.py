"""The motions of an investigation, within what a rig may do, and how well the tip follows one."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from endoscope_bags import open_bag
from endoscope_core.errors import InputError, NotPlayedError
from endoscope_core.metrics import tracking_rmse
from endoscope_core.names import JOINTS
from endoscope_core.physics.description import PlantDescription
from endoscope_core.rig import Rig
from endoscope_core.signals import Signal, hold, move, non_periodic_signal, sequence
from endoscope_core.signals.calibration_motion import calibration_sinusoid
from endoscope_core.signals.motions import again_with_hold, chirp, steps_with_holds, there_and_back
from endoscope_core.signals.sampled_motion import (
    CommandTable,
    read_command_file,
    write_command_file,
)
from endoscope_explain.case import NextExperiment
from endoscope_explain.experiment_motions import SAMPLE_S, answer_to, as_played, is_safe
from endoscope_explain.investigation import log as logs
from endoscope_explain.investigation.log import (
    CALIBRATION,
    COMMISSIONING,
    Log,
    Tracking,
    in_words,
)
from endoscope_explain.recording import BENDING, DESIRED, Array

SHARES = (1.0, 0.75, 0.5, 0.3)
"""Of a motion's size, the first that is safe."""
ALONE_S = 3.0
"""For which `bend_x` moves alone at first: to both ends."""
TOLERANCE = 1.01
"""Of the greatest speed and acceleration: angles of a file are rounded."""


class MotionRefusedError(InputError):
    """A motion that the rig may not make."""


@dataclass(frozen=True)
class RigMotion:
    """A motion that a rig is asked to make."""

    waveform: str
    joint: str  # that it moves; several joined by 'and'
    why: str
    table: CommandTable

    @property
    def duration(self) -> float:
        """In s."""
        return float(self.table.time[-1])

    @property
    def largest(self) -> float:
        """Largest angle in rad, either way."""
        return float(np.abs(self.table.angle).max())

    @property
    def words(self) -> str:
        """As a person is asked for it."""
        return in_words(self.waveform, self.joint, self.duration, math.degrees(self.largest))


def calibration(plant: PlantDescription, rig: Rig) -> RigMotion:
    """The sinusoid that every session plays, on all joints, as large as is allowed; see `_safe`."""
    sinusoid = calibration_sinusoid()
    why = 'Nothing is known of the rig yet but its description.'
    return _safe(CALIBRATION, dict.fromkeys(JOINTS, sinusoid), why, rig, plant)


def commissioning(
    plant: PlantDescription, rig: Rig, improved: PlantDescription | None = None
) -> RigMotion:
    """The commissioning motion as large as is allowed by both plants; see `_safe`."""
    why = 'What is left open or has no name is looked at in wide strokes, a hold and steps.'
    plants = (plant,) if improved is None else (plant, improved)
    return _safe(COMMISSIONING, strokes_hold_and_steps(), why, rig, *plants)


def strokes_hold_and_steps() -> dict[str, Signal]:
    """Wide strokes, a chirp, the strokes again with hold and small loop, and steps, by joint."""
    # 28 s and a rest of 1 s, about half as long as `signals.commissioning_motion`. Its strokes of
    # 140 deg are 40 deg wider than the backlash of the worst class, and come again in its second
    # half, which is what is held out. `bend_y` begins once `bend_x` has moved alone, so that
    # whatever appears on it meanwhile is coupling. Rounded corners take 2 deg.
    reach = math.radians(72.0)
    speed = 1.1 * reach
    once, again = there_and_back(reach, speed), again_with_hold(reach, speed)
    # As quick as the rig of the package may be, and none as wide as the strokes.
    levels = tuple(reach * share for share in (-0.5, -0.9, 0.2, -0.3, 0.8))
    steps = steps_with_holds(levels, 0.4, 0.3)
    x = [once, chirp(0.8 * reach, 6.0, 0.3), again, steps]
    y = [hold(ALONE_S), once, chirp(0.8 * reach, 4.0, 0.3), again, steps]
    return {'bend_x': sequence(COMMISSIONING, x), 'bend_y': sequence(COMMISSIONING, y)}


def _safe(
    name: str, motion: Mapping[str, Signal], why: str, rig: Rig, *plants: PlantDescription
) -> RigMotion:
    """The motion by joint as large as is allowed; MotionRefusedError if it is at no size."""
    here = tuple(joint for joint in JOINTS if joint in plants[0].joints)
    time = np.arange(0.0, max(signal.duration for signal in motion.values()) + SAMPLE_S, SAMPLE_S)
    whole = np.stack(
        [motion[joint](time)[0] if joint in here else np.zeros_like(time) for joint in JOINTS],
        axis=1,
    )
    whole *= min(1.0, rig.joints.reach / float(np.abs(whole).max()))
    ceiling = rig.tension.calibration_ceiling
    columns = [JOINTS.index(joint) for joint in here]
    for share in SHARES:
        ticks, angle = as_played(time, share * whole, rig)
        answers = [
            answer_to(plant.of_joints(here), name, ticks, angle[:, columns], rig)
            for plant in plants
        ]
        if all(is_safe(answer, ceiling, math.inf) for answer in answers):
            return RigMotion(name, ' and '.join(here), why, CommandTable(JOINTS, ticks, angle))
    raise MotionRefusedError(
        f'the {name} motion is refused: its plant answers {SHARES[-1]:.0%} of it '
        f'with more than {ceiling:g} N, tension.calibration_ceiling of rig.yaml'
    )


def of_experiment(experiment: NextExperiment) -> RigMotion:
    """The motion of an experiment."""
    table = CommandTable(experiment.joints, np.array(experiment.time), np.array(experiment.command))
    return RigMotion(experiment.waveform, experiment.joint, experiment.why, table)


def require_allowed(motion: RigMotion, rig: Rig) -> None:
    """Raise MotionRefusedError of a motion beyond a rig's limits of angle, speed, acceleration."""
    facts, table = rig.joints, motion.table
    speed = np.diff(table.angle, axis=0) / np.diff(table.time)[:, None]
    middle = 0.5 * (table.time[1:] + table.time[:-1])
    acceleration = np.diff(speed, axis=0) / np.diff(middle)[:, None]
    for what, values, limit, unit in (
        ('angle', table.angle, facts.reach, 'rad'),
        ('speed', speed, TOLERANCE * facts.speed, 'rad/s'),
        ('acceleration', acceleration, TOLERANCE * facts.acceleration, 'rad/s^2'),
    ):
        most = float(np.abs(values).max(initial=0.0))
        if most > limit * (1.0 + 1e-9):
            raise MotionRefusedError(
                f'{motion.waveform} of {motion.joint} is refused: its largest {what} is '
                f'{most:.3g} {unit}, and rig.yaml allows {limit:.3g}'
            )


HELD_OUT = 'held-out motion'
FILE = 'held_out.csv'
DURATION_S = 15.0
LEAD_S = 4.0
"""Before errors count, the tip goes as far to either side as it will, so that play and friction are
where the same way has led them, whatever was before and whichever plant is inverted."""
TRACKED_SHARE = 0.4
"""Of the largest angle of the calibration: what compensation adds to it, up to 50 deg, stays within
what the rig has been through where that was played in full."""

PlayThrough = Callable[[RigMotion, Path, Path, Path], None]
"""Plays a motion, which a file holds, to a bag, through the inverse of the plant of another."""


@dataclass(frozen=True)
class Tracked:
    """A motion as it was asked for and as the tip made it."""

    time: Array  # (N,), s since the motion began, which is led into for `LEAD_S`
    desired: Array  # (N, J), rad
    tip: Array  # (N, J), rad

    @property
    def rmse(self) -> float:
        """In rad, over all joints."""
        return tracking_rmse(self.desired, self.tip)


def held_out(plant: PlantDescription, rig: Rig) -> RigMotion:
    """A motion of both joints that is among no experiments."""
    first = calibration(plant, rig)
    signal = non_periodic_signal(DURATION_S)
    time = np.arange(0.0, LEAD_S + signal.duration, SAMPLE_S)
    lead = time < LEAD_S
    angle = np.asarray(signal(time[~lead] - LEAD_S)[0])
    largest = TRACKED_SHARE * first.largest
    angle *= largest / float(np.abs(angle).max())
    parts = [move(0.0, 1.0, 1.0), move(1.0, -1.0, 2.0), move(-1.0, angle[0] / largest, 1.0)]
    aside = sequence('to either side', parts)
    angle = np.concatenate([largest * aside(time[lead])[0], angle])
    columns = [angle if joint in plant.joints else 0.0 * angle for joint in JOINTS]
    table = CommandTable(JOINTS, *as_played(time, np.stack(columns, axis=1), rig))
    why = 'It is among no experiments: it shows what the improved plant is good for.'
    return RigMotion(HELD_OUT, first.joint, why, table)


def with_tracking(
    log: Log, folder: Path, plant_file: Path, motion: RigMotion, rig: Rig, play: PlayThrough
) -> Log:
    """The log with how the tip follows by the described and by the improved plant, or why not."""
    require_allowed(motion, rig)
    write_command_file(folder / FILE, motion.table.time, motion.table.angle, JOINTS)
    found: tuple[Tracking, ...] = ()
    for by, file in (('described', plant_file), ('improved', folder / logs.PLANT)):
        bag = f'tracking_{by}_{1 + sum(1 for _ in folder.glob(f"tracking_{by}_*"))}'
        try:
            play(motion, folder / FILE, folder / bag, file)
        except NotPlayedError as error:
            return replace(log, tracking=(), untracked=str(error))
        rmse = math.degrees(tracked(folder / bag, folder / FILE).rmse)
        found = (*found, Tracking(by, bag, rmse))
    return replace(log, tracking=found, untracked='')


def tracked(bag: Path, file: Path) -> Tracked:
    """What a bag has of a motion that a file asks for, by the time of the file, once led into."""
    opened, table = open_bag(bag), read_command_file(file)
    stream, tip = (opened.joint_state(topic).select(JOINTS) for topic in (DESIRED, BENDING))
    stamp_s = 1e-9 * (stream.stamp_ns - stream.stamp_ns[0])
    columns = stream.require('position').T

    def desired(time: Array) -> Array:
        return np.stack([np.interp(time, stamp_s, column) for column in columns], axis=1)

    # The way to the beginning of a motion takes as long as it takes.
    spare = max(0.0, stamp_s[-1] - table.time[-1])
    begins = np.arange(0.0, spare + SAMPLE_S, SAMPLE_S)
    off = [tracking_rmse(table.angle, desired(table.time + begin)) for begin in begins]
    begin = float(begins[np.argmin(off)])
    since = 1e-9 * (tip.stamp_ns - stream.stamp_ns[0]) - begin
    inside = (since >= LEAD_S) & (since <= stamp_s[-1] - begin)
    return Tracked(since[inside], desired(since[inside] + begin), tip.require('position')[inside])
