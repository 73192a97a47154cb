"""Feedback of the tracker: a learning law on every joint, safe to switch at any time."""

from __future__ import annotations

import bisect
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.control.adaptive_backlash import AdaptiveBacklashJoint, AdaptiveBacklashSettings
from endoscope_core.control.limits import SHARE_OF_TRAVEL, Play, limited, worked_off
from endoscope_core.hysteresis.bouc_wen import bouc_wen_normalised_step

Vector = Sequence[float] | NDArray[np.float64]

STALE_AFTER = 0.15
FADE_TIME = 1.0
RATE = 0.5
"""Greatest speed in rad/s at which what was learnt enters the correction."""

HISTORY = 0.6


@dataclass(frozen=True)
class TrackerMeasurement:
    """Bending angles (J,) in rad that held at `stamp` (s, on the clock of the desired angles)."""

    stamp: float
    angle: Vector


@dataclass
class _Desired:
    time: float
    angle: tuple[float, ...]
    foreseen: tuple[float, ...]
    direction: tuple[float, ...]
    correction: tuple[float, ...]


@dataclass
class _Output:
    """How one joint's correction comes about: ``weight * raw + offset``, rad."""

    raw: float = 0.0
    weight: float = 0.0
    offset: float = 0.0
    rested: bool = True


class AdaptiveBacklashController:
    """The adaptive backlash law on every joint, safe to switch at any time.

    The correction is to be added to the joint-equivalent feed-forward command. A measurement is
    compared with what was desired at its own stamp, so that a late tracker is no error. While the
    tracker has been silent for `stale_after` s the laws stand still and the correction fades out,
    in `fade_time` s at least; it fades in again, with what was learnt, once measurements return, of
    which the first only begins a new count of time.

    Nothing moves of its own accord. While a desired angle rests its law rests and its correction
    stays what it is, whether measurements come, are lost or return. When it moves, whatever fades
    or was learnt moves the correction by no more than half as far (`SHARE_OF_TRAVEL`), and no
    faster than `RATE` and `fade_time` allow.
    """

    def __init__(
        self,
        joints: int,
        settings: AdaptiveBacklashSettings | None = None,
        stale_after: float = STALE_AFTER,
        fade_time: float = FADE_TIME,
    ) -> None:
        if not (stale_after > 0.0 and fade_time > 0.0):
            raise ValueError(
                f'stale_after = {stale_after} s and fade_time = {fade_time} s must be positive'
            )
        self.settings = settings or AdaptiveBacklashSettings()
        self.refused = 0
        self._joints = joints
        self._none = (0.0,) * joints
        self._stale_after = stale_after
        self._fade_time = fade_time
        self._activated = False
        self._outputs = [_Output() for _ in range(joints)]
        self._plays: list[Play] = []
        self._laws = self._new_laws(joints)
        self._last_stamp = -math.inf
        self._history: deque[_Desired] = deque()

    @property
    def weight(self) -> float:
        """Share of the correction that is applied, 0 to 1; the largest of the joints."""
        return max(output.weight for output in self._outputs)

    @property
    def learnt(self) -> tuple[tuple[float, float], ...]:
        """Gain and backlash (rad) that the correction adds, for each joint."""
        return tuple((law.state.gain, law.state.backlash) for law in self._laws)

    def _new_laws(self, joints: int) -> list[AdaptiveBacklashJoint]:
        return [AdaptiveBacklashJoint(self.settings) for _ in range(joints)]

    def activate(self) -> None:
        """Begin to learn, and to correct as soon as the tracker is fresh."""
        self._activated = True

    def deactivate(self) -> None:
        """Stop learning and let the correction fade out."""
        self._activated = False

    def forget(self) -> None:
        """Drop what has been learnt, for a new tube shape or new feed-forward parameters.

        What the correction held of it is worked off as the desired angle moves.
        """
        self._laws = self._new_laws(self._joints)

    def restart(self) -> None:
        """Begin a new stream of desired angles; what has been learnt stays."""
        self._history.clear()
        self._plays = []
        self._last_stamp = -math.inf

    def tracker_fresh(self, time: float) -> bool:
        """Whether the last accepted measurement is recent enough at `time` (s)."""
        return time - self._last_stamp <= self._stale_after

    def step(
        self,
        time: float,
        desired: Vector,
        velocity: Vector,
        measurement: TrackerMeasurement | None = None,
    ) -> NDArray[np.float64]:
        """Correction (J,) in rad, at most `output_limit`, at a time in s later than the last.

        `desired` and `velocity` (J,) are in rad and rad/s; `measurement` has arrived since the step
        before. One that is older than the last, from the future, or not finite is refused and
        counted in `refused`. ValueError if time does not advance or an input has another size or is
        not finite; nothing changes then.
        """
        angle = self._checked('desired', desired)
        speed = self._checked('velocity', velocity)
        dt = self._elapsed(time)
        self._remember(time, angle, speed)
        if measurement is not None:
            self._learn(measurement, time)
        acting = self._activated and self.tracker_fresh(time)
        now = self._history[-1]
        before = self._history[-2] if len(self._history) > 1 else now
        now.correction = tuple(
            self._correct(j, before, now, acting, dt) for j in range(self._joints)
        )
        return np.array(now.correction)

    def _correct(self, j: int, before: _Desired, now: _Desired, acting: bool, dt: float) -> float:
        law, output = self._laws[j], self._outputs[j]
        limit = self.settings.output_limit
        travel = abs(now.foreseen[j] - before.foreseen[j])
        output.rested = output.rested and travel == 0.0
        # What the law says now where it was before: the difference was learnt, not asked for.
        running = dt if travel > 0.0 else 0.0
        relearnt = limited(law.correction(before.foreseen[j], before.direction[j], running), limit)
        output.offset += output.weight * (output.raw - relearnt)
        output.offset = worked_off(output.offset, travel, RATE * dt)
        output.raw = limited(law.correction(now.foreseen[j], now.direction[j], 0.0), limit)
        change = dt / self._fade_time
        if output.raw != 0.0:
            change = min(change, SHARE_OF_TRAVEL * travel / abs(output.raw))
        output.weight = min(1.0, max(0.0, output.weight + (change if acting else -change)))
        return limited(output.weight * output.raw + output.offset, limit)

    def _elapsed(self, time: float) -> float:
        if not math.isfinite(time):
            raise ValueError(f'time = {time} must be finite')
        if not self._history:
            return 0.0
        dt = time - self._history[-1].time
        if dt <= 0.0:
            raise ValueError(
                f'time must advance: {time:.6f} s after {self._history[-1].time:.6f} s'
            )
        return dt

    def _remember(self, time: float, angle: list[float], speed: list[float]) -> None:
        ahead = [a + self.settings.lead * v for a, v in zip(angle, speed, strict=True)]
        if not self._plays:
            self._plays = [Play(0.5 * self.settings.dead_band, a) for a in ahead]
        foreseen = tuple(play.follow(a) for play, a in zip(self._plays, ahead, strict=True))
        if self._history:
            last, travel = self._history[-1], self.settings.direction_travel
            direction = tuple(
                float(bouc_wen_normalised_step(s, new - old, travel, 0.0, 1.0))
                for s, new, old in zip(last.direction, foreseen, last.foreseen, strict=True)
            )
        else:
            direction = (0.0,) * self._joints
        self._history.append(_Desired(time, tuple(angle), foreseen, direction, self._none))
        while self._history[0].time < time - HISTORY:
            self._history.popleft()

    def _learn(self, measurement: TrackerMeasurement, time: float) -> None:
        measured = [float(angle) for angle in measurement.angle]
        stamp = measurement.stamp
        usable = (
            len(measured) == self._joints
            and all(map(math.isfinite, measured))
            and self._last_stamp < stamp <= time
        )
        if not usable:
            self.refused += 1
            return
        dt = stamp - self._last_stamp
        self._last_stamp = stamp
        rested = [output.rested for output in self._outputs]
        for output in self._outputs:
            output.rested = True
        if dt > self._stale_after:
            return
        then = self._at(stamp)
        answered = self._at(stamp - self.settings.response_delay)
        if not self._activated or then is None or answered is None:
            return
        for j, law in enumerate(self._laws):
            if rested[j]:
                continue
            law.learn(
                measured[j] - then.angle[j],
                answered.foreseen[j],
                answered.direction[j],
                dt,
            )

    def _at(self, time: float) -> _Desired | None:
        """What was desired at `time`, None if that is forgotten or was before the start."""
        index = bisect.bisect_right(self._history, time, key=lambda item: item.time) - 1
        return self._history[index] if index >= 0 else None

    def _checked(self, name: str, values: Vector) -> list[float]:
        numbers = list(map(float, values))
        if len(numbers) != self._joints or not all(map(math.isfinite, numbers)):
            raise ValueError(f'{name} must be {self._joints} finite numbers, not {numbers}')
        return numbers


class Corrections:
    """The two newest corrections (J,) in rad; which one a command gets must not depend on chance.

    `fresh_ns` is how old one may be that is still added to a command.
    """

    def __init__(self, fresh_ns: int) -> None:
        self._fresh_ns = fresh_ns
        self._newest: tuple[tuple[int, tuple[float, ...]], ...] = ()

    def restart(self) -> None:
        """Forget them."""
        self._newest = ()

    def add(self, stamp_ns: int, angles: tuple[float, ...]) -> None:
        """Take the next one."""
        self._newest = (*self._newest[-1:], (stamp_ns, angles))

    def before(self, stamp_ns: int) -> NDArray[np.float64] | None:
        """The newest one from before a command of this stamp, unless it is too old."""
        for corrected_ns, angles in reversed(self._newest):
            if corrected_ns < stamp_ns:
                fresh = stamp_ns - corrected_ns <= self._fresh_ns
                return np.array(angles) if fresh else None
        return None
