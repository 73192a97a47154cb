"""Short motions of which an experiment is chosen, and what a plant would answer to one, safely."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.simulator import TICK, simulate
from endoscope_core.rig import Rig
from endoscope_core.safety import MotionLimits, MotionShaper
from endoscope_core.signals import Signal, hold, move, sequence
from endoscope_core.signals.motions import LOOP, chirp, multisine, ramps, steps_with_holds
from endoscope_explain.recording import Array, RigRecording, Series

SAMPLE_S = 0.01
SETTLES_S = 1.0
"""Most that a motion may end later than was asked for, because the rig is slower."""
SIZES = (1.0, 0.5)
"""Shares of a joint's reach at which a motion is on offer."""
RISE_S = 0.4
"""Of a step: about as quick as the rig of the package may be over its whole reach."""
LEAST_REACH = 0.05
"""Of a joint, rad: one that was moved by less was hardly moved."""
AT_REST = 0.01
"""Of zero, rad, where a motion ends."""
SMALLEST = 0.3
"""Of its size, a motion that is not safe is made smaller to."""


@dataclass(frozen=True)
class Segment:
    """A motion from rest to rest."""

    name: str
    joint: str  # that moves
    time: Array  # (N,), s
    angle: Array  # (N, J), desired bending angles in rad, of all joints of a rig

    @property
    def duration(self) -> float:
        """In s."""
        return float(self.time[-1])


def as_played(time: Array, angle: Array, rig: Rig, tick: float = TICK) -> tuple[Array, Array]:
    """A motion (N, J) in rad at times (N,) as the console plays it: within a rig's limits."""
    shaper = MotionShaper(_limits(rig, angle.shape[1]))
    ticks = np.arange(time[0], time[-1] + SETTLES_S, tick)
    wanted = np.stack([np.interp(ticks, time, column) for column in angle.T], axis=1)
    shaper.restart(wanted[0])
    shaped = np.array([shaper.shape(each, tick) for each in wanted.tolist()])
    every = round(SAMPLE_S / tick)
    return ticks[::every], shaped[::every]


def _limits(rig: Rig, joints: int) -> MotionLimits:
    facts = rig.joints
    most = (facts.reach, facts.speed, facts.acceleration, facts.entry_step)
    return MotionLimits.either_way(joints, *most)


# The same for every question about a rig.
@lru_cache(maxsize=32)
def library(joint: str, reaches: tuple[tuple[str, float], ...], rig: Rig) -> tuple[Segment, ...]:
    """Motions of one of a rig's joints, each up to its reach in rad, as the rig plays them."""
    # Where there are two joints that move, the other one is moved alone, too, and stands bent
    # meanwhile. None where the joint hardly moves, and none that the rig is too slow for.
    joints, most = tuple(name for name, _ in reaches), dict(reaches)
    if most[joint] < LEAST_REACH:
        return ()
    found = []
    for size in SIZES:
        of_size = '' if size == 1.0 else f' of {size:.0%}'
        for signal in _signals(size * most[joint]):
            found.append(_played(f'{signal.name}{of_size}', joint, {joint: signal}, joints, rig))
        for other in (name for name in joints if name != joint and most[name] >= LEAST_REACH):
            angle = size * most[other]
            alone = {other: multisine(angle, 6.0)}
            found.append(_played(f'{other} alone{of_size}', other, alone, joints, rig))
            stroke = _stroke('', size * most[joint], 3.0)
            begun = [hold(1.0), stroke, hold(1.0)]
            bent = sequence(
                '', [move(0.0, angle, 1.0), hold(stroke.duration, angle), move(angle, 0.0, 1.0)]
            )
            beside = {joint: sequence('', begun), other: bent}
            found.append(_played(f'stroke beside {other}{of_size}', joint, beside, joints, rig))
    return tuple(each for each in found if np.all(np.abs(each.angle[-1]) < AT_REST))


def _signals(reach: float) -> Iterator[Signal]:
    """Motions between -+`reach` rad, by name; they last 2 to 10 s."""
    yield _stroke('stroke', reach, 4.0)
    yield _stroke('quick stroke', reach, 2.0)
    yield _stroke('slow stroke', reach, 8.0)
    for side, way in (('positive', reach), ('negative', -reach)):
        rests = [move(0.0, way, 1.0), hold(5.0, way), move(way, 0.0, 1.0)]
        yield sequence(f'{side} hold', rests)
        inner = [way, way - np.sign(way) * min(LOOP, abs(reach))]
        loops = ramps((0.0, inner[0], inner[1], inner[0], inner[1], 0.0), abs(reach))
        yield sequence(f'{side} loops', [loops])
        yield sequence(
            f'{side} steps', [steps_with_holds((0.4 * way, way, 0.6 * way), RISE_S, 0.8)]
        )
    small = min(LOOP, reach)
    yield sequence('loops around zero', [ramps((0.0, small, -small, small, -small, 0.0), reach)])
    yield sequence('steps', [steps_with_holds((reach, -0.4 * reach, 0.3 * reach, -reach), RISE_S)])
    yield sequence('chirp', [chirp(0.7 * reach, 5.0, 0.3, 5.0)])
    yield sequence('multisine', [multisine(reach, 6.0)])
    yield nested_reversals(reach)
    yield fast_and_slow(reach)


def _stroke(name: str, reach: float, duration: float) -> Signal:
    """To both sides and back, smoothly (`reach` in rad, all of it in `duration` s)."""
    quarter = 0.25 * duration
    return sequence(
        name,
        [
            move(0.0, reach, quarter),
            move(reach, -reach, 2.0 * quarter),
            move(-reach, 0.0, quarter),
            hold(0.3),
        ],
    )


def nested_reversals(reach: float) -> Signal:
    """Turn back earlier and earlier: inner loops within outer ones (`reach` in rad)."""
    parts, here = [], 0.0
    for share in (1.0, -0.8, 0.6, -0.4, 0.4, -0.2, 0.0):
        target = share * reach
        parts.append(move(here, target, 0.3 + 0.7 * abs(target - here) / max(reach, 1e-9)))
        here = target
    return sequence('nested reversals', parts)


def fast_and_slow(reach: float) -> Signal:
    """Make the same stroke at two speeds: what depends on speed shows against what does not."""
    strokes = [_stroke('', reach, 6.0), _stroke('', reach, 1.6)]
    return sequence('fast and slow', strokes)


def _played(
    name: str, joint: str, signals: dict[str, Signal], joints: tuple[str, ...], rig: Rig
) -> Segment:
    end = max(signal.duration for signal in signals.values())
    time = np.arange(0.0, end + 0.5 * SAMPLE_S, SAMPLE_S)
    still = np.zeros_like(time)
    columns = [signals[each](time)[0] if each in signals else still for each in joints]
    # Longer steps are ten times less work, where the rig does not take them for a stall.
    tick = SAMPLE_S if _limits(rig, len(joints)).longest_period >= SAMPLE_S else TICK
    return Segment(name, joint, *as_played(time, np.stack(columns, axis=1), rig, tick))


def answer_to(
    plant: PlantDescription, name: str, time: Array, angle: Array, rig: Rig
) -> RigRecording:
    """A plant's noise-free answer to a motion (N, J) in rad at times (N,)."""
    # The tracker at its rate, all else every tick.
    ticks = np.arange(0.0, time[-1], TICK)
    desired = np.stack([np.interp(ticks, time, column) for column in angle.T], axis=1)
    shaft = rig.joints.gear * desired
    answer = simulate(plant, shaft)
    slow = slice(None, None, max(1, round(1.0 / (plant.sensors.tracker_rate * TICK))))
    return RigRecording(
        name,
        0.0,
        plant.joint_names(),
        Series.of('motor/servo_jp', ticks, shaft),
        Series.of('wires/measured_js', ticks, answer.tension),
        Series.of('slave/measured_js', ticks[slow], answer.bending[slow]),
        Series.of('motor/measured_js', ticks, answer.shaft_position),
        Series.of('motor/measured_js', ticks, answer.shaft_velocity),
        Series.of('motor/measured_js', ticks, answer.shaft_effort),
        rig=rig,
    )


def is_safe(
    recording: RigRecording,
    tension_limit: float | Array,
    bending_limit: float | Array,
    slack_limit: float | Array = 0.0,
) -> bool:
    """Whether an imagined motion stays within tensions in N, (J, 2), and angles in rad, (J,)."""
    assert recording.tension is not None
    return bool(
        np.all(recording.tension.values <= tension_limit)
        and np.all(recording.tension.values >= slack_limit)
        and np.all(np.abs(recording.bending.values) <= bending_limit)
    )
