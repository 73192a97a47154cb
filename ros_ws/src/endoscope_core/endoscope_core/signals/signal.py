"""Angle and velocity over time, and how signals are composed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Signal:
    """Angle (rad) and velocity of one joint over time (s); starts and ends at rest."""

    name: str  # what the signal is called on the command line and in reports
    # Length in s. Before 0 and after `duration` the first and the last angle are held.
    duration: float
    # ``evaluate(time (N,)) -> (angle (N,), velocity (N,))`` in rad and rad/s for ``0 <= time <=
    # duration``.
    evaluate: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    # ``(start, end)`` in s: where the signal has its nominal form, without ramps; figures are
    # taken there.
    steady: tuple[float, float]

    def __call__(self, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Angle and velocity at the given times.

        `time` (N,): seconds since the signal began.
        Returns `angle, velocity`: rad and rad/s.
        """
        asked = np.asarray(time, dtype=float)
        flat = np.atleast_1d(asked).ravel()
        angle, velocity = self.evaluate(np.clip(flat, 0.0, self.duration))
        moving = (flat >= 0.0) & (flat <= self.duration)
        velocity = np.where(moving, velocity, 0.0)
        return angle.reshape(asked.shape), velocity.reshape(asked.shape)

    def scaled(self, factor: float) -> Signal:
        """The same motion, `factor` times as far and as fast."""

        def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
            angle, velocity = self.evaluate(time)
            return factor * angle, factor * velocity

        return replace(self, evaluate=evaluate)


@dataclass(frozen=True)
class Motion:
    """A signal for each joint, all starting together."""

    name: str  # what the motion is called
    # Signal of each joint, in the order of the columns that :meth:`sample` returns.
    joints: Mapping[str, Signal]

    @property
    def duration(self) -> float:
        """Length of the longest signal in s."""
        return max(signal.duration for signal in self.joints.values())

    @property
    def steady(self) -> tuple[float, float]:
        """Interval in s in which every joint has its nominal form."""
        return (
            max(signal.steady[0] for signal in self.joints.values()),
            min(signal.steady[1] for signal in self.joints.values()),
        )

    def sample(self, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Angle and velocity (N, J) or (J,) of all joints, rad and rad/s, at times (N,) or one."""
        pairs = [signal(time) for signal in self.joints.values()]
        angle = np.stack([pair[0] for pair in pairs], axis=-1)
        velocity = np.stack([pair[1] for pair in pairs], axis=-1)
        return angle, velocity


def hold(duration: float, angle: float = 0.0) -> Signal:
    """Stay at an angle (rad) for a while (s)."""

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        return np.full_like(time, angle), np.zeros_like(time)

    return Signal('hold', duration, evaluate, (0.0, duration))


def sequence(name: str, parts: Sequence[Signal]) -> Signal:
    """Play signals one after the other; the `steady` interval is the whole.

    ValueError if two neighbours do not meet at one angle: a jump would be commanded.
    """
    starts = np.concatenate(([0.0], np.cumsum([part.duration for part in parts])))
    for before, after in pairwise(parts):
        gap = float(after(0.0)[0] - before(before.duration)[0])
        if abs(gap) > 1e-6:
            raise ValueError(
                f'{name}: {after.name} begins {gap:.3g} rad from the end of {before.name}'
            )

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle = np.empty_like(time)
        velocity = np.empty_like(time)
        index = np.clip(np.searchsorted(starts, time, side='right') - 1, 0, len(parts) - 1)
        for k, part in enumerate(parts):
            chosen = index == k
            angle[chosen], velocity[chosen] = part(time[chosen] - starts[k])
        return angle, velocity

    total = float(starts[-1])
    return Signal(name, total, evaluate, (0.0, total))


def smooth_step(phase: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Quintic rise 0 to 1 and its slope, at phases (N,); no speed or acceleration at the ends."""
    s = np.clip(phase, 0.0, 1.0)
    value = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    slope = 30.0 * s**2 * (1.0 - s) ** 2
    return value, slope


def window(
    time: FloatArray, duration: float, rise: float, fall: float
) -> tuple[FloatArray, FloatArray]:
    """Amplitude (N,) that rises smoothly to 1 and falls back, and its rate in 1/s; times in s."""
    up, up_slope = smooth_step(time / rise)
    down, down_slope = smooth_step((duration - time) / fall)
    return up * down, up_slope / rise * down - up * down_slope / fall


def move(start: float, end: float, duration: float) -> Signal:
    """Minimum-jerk move from one angle (rad) to another in `duration` s."""

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        value, slope = smooth_step(time / duration)
        return start + (end - start) * value, (end - start) * slope / duration

    return Signal('move', duration, evaluate, (0.0, duration))


def come_to_rest(angle: float, velocity: float, acceleration: float, duration: float) -> Signal:
    """Quintic from a moving state (rad, rad/s, rad/s^2) to rest at angle zero in `duration` s."""
    t = duration
    system = np.array(
        [
            [t**3, t**4, t**5],
            [3 * t**2, 4 * t**3, 5 * t**4],
            [6 * t, 12 * t**2, 20 * t**3],
        ]
    )
    reached = np.array(
        [
            angle + velocity * t + 0.5 * acceleration * t**2,
            velocity + acceleration * t,
            acceleration,
        ]
    )
    c3, c4, c5 = np.linalg.solve(system, -reached)

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        x = (
            angle
            + velocity * time
            + 0.5 * acceleration * time**2
            + c3 * time**3
            + c4 * time**4
            + c5 * time**5
        )
        v = velocity + acceleration * time + 3 * c3 * time**2 + 4 * c4 * time**3 + 5 * c5 * time**4
        return x, v

    return Signal('come_to_rest', duration, evaluate, (0.0, duration))
