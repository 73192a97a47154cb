"""Recursive least squares of what the feed-forward's hysteresis parameters lack."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from endoscope_core.control.limits import COUNT
from endoscope_core.control.tracker_feedback import (
    FADE_TIME,
    STALE_AFTER,
    TrackerFeedback,
    check_settings,
)


@dataclass(frozen=True)
class RecursiveHysteresisSettings:
    """Of the recursive least squares; angles in rad, times in s."""

    transmission_gain: float = 0.95  # ``a``, tip motion for one of the motor once the wires slide
    memory: float = 3.0  # time constant of forgetting, s
    # Of the tracker and of all that the regression leaves out, rad.
    noise: float = math.radians(1.0)
    # Standard deviations before anything was measured.
    gain_spread: float = 0.1
    backlash_spread: float = math.radians(20.0)
    offset_spread: float = math.radians(3.0)
    # The direction memory must be this far on its side: what happens while the dead zone is
    # crossed is not to be learnt from.
    settled: float = 0.95
    # Readings beyond three standard deviations in a row that tell of another tube.
    surprises: int = 4
    # Limits of the estimates and of the correction.
    gain_limit: float = 0.5
    backlash_limit: float = math.radians(45.0)
    offset_limit: float = math.radians(10.0)
    output_limit: float = math.radians(60.0)
    # As in the adaptive law.
    direction_travel: float = math.radians(1.0)
    lead: float = 0.06
    response_delay: float = 0.06
    dead_band: float = 2.0 * COUNT

    def __post_init__(self) -> None:
        check_settings(
            self, ('transmission_gain', 'memory', 'noise', 'direction_travel', 'output_limit')
        )


class RecursiveHysteresisJoint:
    """Recursive least squares with forgetting, for one joint (the first paper's outlook).

    With the notation of `adaptive_backlash_law`, ``e = a (v - g* theta - D* s - o*)``: what should
    have been added is ``v - e / a = [theta, s, 1] . [g*, D*, o*]``, linear in the unknowns. Their
    estimates minimise the squares of the past, weighed by ``exp(-age / memory)``. Forgetting rests
    while the covariance has grown back to what it was in the beginning, so that standing still
    forgets nothing (no blow-up); one reading counts for no more than three standard deviations, and
    several beyond that in a row return the covariance to its beginning: the tube has been bent.
    """

    def __init__(self, settings: RecursiveHysteresisSettings) -> None:
        c = settings
        self.settings = settings
        self.estimates = np.zeros(3)
        self._first = np.diag([c.gain_spread, c.backlash_spread, c.offset_spread]) ** 2
        self.covariance = self._first.copy()
        self._surprises = 0
        self._limits = np.array([c.gain_limit, c.backlash_limit, c.offset_limit])

    def learn(
        self, error: float, correction: float, desired: float, direction: float, dt: float
    ) -> None:
        c = self.settings
        if abs(direction) < c.settled:
            return
        regressor = np.array([desired, direction, 1.0])
        grown = self.covariance * math.exp(min(dt, c.memory) / c.memory)
        if np.trace(grown / np.diag(self._first)[:, None]) <= 3.0:
            self.covariance = grown
        side = self.covariance @ regressor
        spread = c.noise**2 + float(regressor @ side)
        wanted = correction - error / c.transmission_gain
        innovation = wanted - float(regressor @ self.estimates)
        limit = 3.0 * math.sqrt(spread)
        self._surprises = self._surprises + 1 if abs(innovation) > limit else 0
        if self._surprises >= c.surprises:
            self._surprises = 0
            self.covariance = self._first.copy()
            side = self.covariance @ regressor
            spread = c.noise**2 + float(regressor @ side)
            limit = 3.0 * math.sqrt(spread)
        innovation = min(limit, max(-limit, innovation))
        moved = self.estimates + side / spread * innovation
        self.estimates = np.clip(moved, -self._limits, self._limits)
        covariance = self.covariance - np.outer(side, side) / spread
        self.covariance = 0.5 * (covariance + covariance.T)

    def correction(self, desired: float, direction: float, dt: float) -> float:
        """``g theta + D s + o`` in rad."""
        gain, backlash, offset = self.estimates.tolist()
        return float(gain * desired + backlash * direction + offset)


class RecursiveHysteresisController(TrackerFeedback[RecursiveHysteresisJoint]):
    """Recursive least squares on every joint.

    `stale_after` and `fade_time` in s: see `TrackerFeedback`.
    """

    def __init__(
        self,
        joints: int,
        settings: RecursiveHysteresisSettings | None = None,
        stale_after: float = STALE_AFTER,
        fade_time: float = FADE_TIME,
    ) -> None:
        chosen = settings or RecursiveHysteresisSettings()
        super().__init__(
            joints, chosen, lambda: RecursiveHysteresisJoint(chosen), stale_after, fade_time
        )

    @property
    def learnt(self) -> tuple[tuple[float, float], ...]:
        """Gain and backlash (rad) that the correction adds, for each joint."""
        return tuple((float(law.estimates[0]), float(law.estimates[1])) for law in self.laws)
