"""The motions of an investigation: within what a rig may do, or refused."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.errors import InputError
from endoscope_core.names import JOINTS
from endoscope_core.physics.description import PlantDescription
from endoscope_core.rig import Rig
from endoscope_core.signals import Signal, hold, sequence
from endoscope_core.signals.motions import (
    again_with_hold,
    chirp,
    steps_with_holds,
    there_and_back,
)
from endoscope_core.signals.sampled_motion import CommandTable
from endoscope_explain.case import NextExperiment
from endoscope_explain.experiment_motions import SAMPLE_S, as_played
from endoscope_explain.imagined_motion import answer_to, is_safe
from endoscope_explain.investigation.log import COMMISSIONING, in_words

Array = NDArray[np.float64]

SHARES = (1.0, 0.75, 0.5, 0.3)
"""Of the commissioning motion's size, the first that is safe."""
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


def first_motion() -> dict[str, Signal]:
    """Wide strokes, a chirp, the strokes again with a hold and a small loop, and steps, by joint.

    28 s and a rest of 1 s, about half as long as `signals.commissioning_motion`, as what it leaves
    open is asked for by the next one. Its strokes of 140 deg are 40 deg wider than the backlash of
    the worst class, and come again in its second half, which is what is held out. `bend_y` begins
    once `bend_x` has moved alone, so that whatever appears on it meanwhile is coupling.
    """
    # Rounded corners take 2 deg.
    reach = math.radians(72.0)
    speed = 1.1 * reach
    once, again = there_and_back(reach, speed), again_with_hold(reach, speed)
    # As quick as the rig of the package may be, and none as wide as the strokes.
    levels = tuple(reach * share for share in (-0.5, -0.9, 0.2, -0.3, 0.8))
    steps = steps_with_holds(levels, 0.4, 0.3)
    x = [once, chirp(0.8 * reach, 6.0, 0.3), again, steps]
    y = [hold(ALONE_S), once, chirp(0.8 * reach, 4.0, 0.3), again, steps]
    return {'bend_x': sequence(COMMISSIONING, x), 'bend_y': sequence(COMMISSIONING, y)}


def commissioning(plant: PlantDescription, rig: Rig) -> RigMotion:
    """The commissioning motion as large as the rig's limits and the described plant allow.

    MotionRefusedError if the described plant answers it beyond them at any size.
    """
    motion = first_motion()
    time = np.arange(0.0, max(signal.duration for signal in motion.values()), SAMPLE_S)
    whole = np.stack(
        [
            motion[joint](time)[0] if joint in plant.joints else np.zeros_like(time)
            for joint in JOINTS
        ],
        axis=1,
    )
    whole *= min(1.0, rig.joints.reach / float(np.abs(whole).max()))
    ceiling = rig.tension.calibration_ceiling
    here = tuple(joint for joint in JOINTS if joint in plant.joints)
    columns = [JOINTS.index(joint) for joint in here]
    for share in SHARES:
        ticks, angle = as_played(time, share * whole, rig)
        answer = answer_to(plant.of_joints(here), COMMISSIONING, ticks, angle[:, columns], rig)
        if is_safe(answer, ceiling, math.inf):
            why = 'Nothing is known of the rig yet but its description.'
            table = CommandTable(JOINTS, ticks, angle)
            return RigMotion(COMMISSIONING, ' and '.join(here), why, table)
    raise MotionRefusedError(
        f'the commissioning motion is refused: the described plant answers {SHARES[-1]:.0%} of it '
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
