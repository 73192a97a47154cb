"""What of a motion was made before: there alone a fit can be checked by what it has not seen.

A hysteresis loop has branches: where the tip is depends on the command, on which way it moves, and
on where it last turned. A moment whose branch was passed before is a state seen twice, so that one
visit can be fitted and the other one judged. What was visited once only was fitted, and no
held-out sample shows whether it would come again.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.spatial import KDTree

from endoscope_core.physics.layout import IN_COMMAND
from endoscope_core.physics.simulator import TICK
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.recording import Array, Mask

EVERY_S = 0.02
"""Time between the moments compared."""
APART_S = 1.0
APART_SHARE = 0.05
"""Of the recording: a slow ramp has left the neighbourhood of an angle by then."""
NEAR_ANGLE = 0.02
NEAR_SPEED = 0.10
NEAR_TURN = 0.10
"""Shares of range, largest speed and range again, within which angle, speed and the last turn of a
command are those of another moment."""
LEAST_SHARE = 0.10
"""Share of the recording that must have been seen before; a calibration of 9 s has 0.13."""

BLOCK_S = 2.0
EVERY = 4
GAP_S = 0.2
"""Left out on both sides of what is held out, for the memory of wires and tracker."""


@dataclass(frozen=True)
class Stroke:
    """A motion between two turns."""

    start: float  # rad
    end: float  # rad
    revisited: float  # share that was passed before, or is passed again

    @property
    def twice(self) -> bool:
        """Whether most of it was made at another time as well."""
        return self.revisited > 0.5


def motion_repeats(observation: JointObservation) -> bool:
    """Whether enough of a joint's commanded motion has been commanded before."""
    # A smooth force that depends on time explains any single pass through the workspace, and
    # nothing of the next one.
    return float(np.mean(seen_before(_command(observation), observation.tick))) >= LEAST_SHARE


def seen_before(command: Array, tick: float = TICK) -> Mask:
    """Which moments, every `EVERY_S` of a command (N,), are on a branch that was passed before."""
    return _passed(command, tick)[0]


def _passed(command: Array, tick: float) -> tuple[Mask, Mask]:
    """Which moments are on a branch that was passed before, and on one that is passed again."""
    every = _ticks(tick)
    return _passed_by(command[::every].tobytes(), every * tick)


# Every candidate of a search is judged on the same motion.
@lru_cache(maxsize=16)
def _passed_by(moments: bytes, apart_s: float) -> tuple[Mask, Mask]:
    """Those of angles at moments `apart_s` from each other."""
    # Before is at least `APART_S` and `APART_SHARE` of the recording earlier.
    angle = np.frombuffer(moments)
    speed = np.gradient(angle) if len(angle) > 1 else np.zeros_like(angle)
    span = float(np.ptp(angle))
    turned = _last_turn(angle, NEAR_ANGLE * span)
    near_speed = NEAR_SPEED * np.max(np.abs(speed), initial=0.0)
    apart = max(round(APART_S / apart_s), round(APART_SHARE * len(angle)))
    before, again = np.zeros(len(angle), dtype=bool), np.zeros(len(angle), dtype=bool)
    for i in range(apart + 1, len(angle)):
        earlier = slice(i - apart)
        same = (
            (np.abs(angle[earlier] - angle[i]) <= NEAR_ANGLE * span)
            & (np.abs(speed[earlier] - speed[i]) <= near_speed)
            & (np.abs(turned[earlier] - turned[i]) <= NEAR_TURN * span)
        )
        before[i] = np.any(same)
        again[earlier] |= same
    before.flags.writeable = again.flags.writeable = False
    return before, again


@dataclass(frozen=True)
class Visited:
    """Branches that a command has passed."""

    passed: KDTree | None  # states over what is near; None where nothing moved
    span: float  # of the angle, rad
    scales: Array  # (3,), of angle, speed and last turn within which they are those of a moment

    @staticmethod
    def by(command: Array) -> 'Visited':
        """Those of a command (M,) in rad on ticks."""
        angle = command[:: _ticks(TICK)]
        span = float(np.ptp(angle))
        if len(angle) < 2 or span == 0.0:
            return Visited(None, span, np.ones(3))
        states = _states(angle, span)
        fastest = float(np.max(np.abs(states[:, 1])))
        scales = np.array((NEAR_ANGLE * span, NEAR_SPEED * fastest, NEAR_TURN * span))
        return Visited(KDTree(states / scales), span, scales)

    def newly(self, command: Array) -> float:
        """Share of another command (N,) in rad on ticks that is on none of them."""
        if self.passed is None:
            return 1.0
        states = _states(command[:: _ticks(TICK)], self.span) / self.scales
        near, _ = self.passed.query(states, p=np.inf, distance_upper_bound=1.0 + 1e-9)
        return float(np.mean(np.isinf(near)))


def _states(angle: Array, span: float) -> Array:
    """Angle, speed and last turn (N, 3) of moments."""
    return np.stack([angle, np.gradient(angle), _last_turn(angle, NEAR_ANGLE * span)], axis=1)


def strokes(command: Array, tick: float = TICK) -> list[Stroke]:
    """What a command (N,) in rad makes from turn to turn, and which share of it comes again."""
    angle, (before, again) = command[:: _ticks(tick)], _passed(command, tick)
    least = NEAR_ANGLE * float(np.ptp(angle))
    return [
        Stroke(
            float(angle[a]),
            float(angle[b]),
            float(np.mean((before | again)[a : b + 1])),
        )
        for a, b in pairwise(_turns(angle, least))
        if abs(angle[b] - angle[a]) > least
    ]


def _turns(angle: Array, least: float) -> list[int]:
    """First moment, those of turns by more than `least`, and the last one."""
    bounds, extreme, way = [0], 0, 0.0
    for i in range(1, len(angle)):
        moved = angle[i] - angle[extreme]
        if way * moved > 0.0 or (way == 0.0 and abs(moved) > least):
            extreme, way = i, float(np.sign(moved))
        elif way != 0.0 and abs(moved) > least:
            bounds.append(extreme)
            extreme, way = i, float(np.sign(moved))
    return [*bounds, len(angle) - 1]


def _last_turn(angle: Array, least: float) -> Array:
    """Angle (N,) at which a command last turned, at first where it began."""
    turned = np.empty_like(angle)
    for turn in _turns(angle, least)[:-1]:
        turned[turn:] = angle[turn]
    return turned


def held_out(observation: JointObservation) -> tuple[Mask, Mask]:
    """Samples (size,) of a recording that may be fitted, and those that are held out to judge."""
    # Held out is what the second half of a motion makes again: every state that is judged was
    # fitted before, and what was fitted to a time alone has to foretell. Where hardly anything is
    # made again, blocks are held out.
    time, begun = observation.times, 0.5 * observation.duration
    seen = seen_before(_command(observation), observation.tick)
    apart = _ticks(observation.tick) * observation.tick
    moments = apart * np.arange(len(seen))
    seen = seen & (moments >= begun)
    if np.mean(seen) < LEAST_SHARE:
        judged = _in_last_block(time)
        if judged.any():
            return _far_from_last_block(time), judged
        # There is no whole block to hold out.
        return ~judged, ~judged
    judged = seen[np.clip(np.rint(time / apart).astype(np.int64), 0, len(seen) - 1)]
    near = np.interp(time, moments, _widened(seen, round(GAP_S / apart))) > 0.0
    return ~near, judged


def _widened(seen: Mask, reach: int) -> Array:
    """How many held-out moments are within `reach` moments."""
    return np.convolve(seen, np.ones(2 * reach + 1), mode='same').round()


def _in_last_block(time: Array) -> Mask:
    return np.asarray(np.mod(time, BLOCK_S * EVERY) >= BLOCK_S * (EVERY - 1))


def _far_from_last_block(time: Array) -> Mask:
    phase = np.mod(time, BLOCK_S * EVERY)
    return np.asarray((phase >= GAP_S) & (phase < BLOCK_S * (EVERY - 1) - GAP_S))


def folds(time: Array) -> list[tuple[Mask, Mask]]:
    """Samples (N,) that are fitted and that are judged, each sample judged once."""
    found = []
    for shift in range(EVERY):
        moved = time + BLOCK_S * (EVERY - 1 - shift)
        judged = _in_last_block(moved)
        if judged.any():
            found.append((_far_from_last_block(moved), judged))
    return found


def _ticks(tick: float) -> int:
    """Between the moments compared."""
    return max(1, round(EVERY_S / tick))


def _command(observation: JointObservation) -> Array:
    return np.asarray(observation.inputs[0, :, IN_COMMAND])
