"""Recursive least squares of the plant's hysteresis parameters, from a slow and late tracker."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.control.internal_model import (
    TICK,
    PhysicalParameters,
    TurningPoints,
    go_through_shafts,
    packed_joint,
    turn_all,
)
from endoscope_core.physics.description import JointParameters
from endoscope_core.physics.layout import INPUTS, JOINT, NOMINAL_KEYS
from endoscope_core.physics.packing import rest_state
from endoscope_core.physics.servo import transition

Array = NDArray[np.float64]

LEARNT = {
    'capstan_exponent': 0.25,
    'wire_stiffness': 0.1,
    'pretension': 0.1,
    'joint_friction': 0.1,
    'joint_stiffness': 0.1,
    'joint_presliding': 0.15,
}
"""What is learnt, and the standard deviation of its logarithm before anything was measured."""

NOTABLE = 2e-3
"""Change of the logarithm of a parameter for which the models are set up again."""

_BENT_ANEW = 0.7
"""Standard deviation of the logarithm of the capstan exponent once the tube was bent."""
_LARGEST_STEP = 0.05
"""Of a logarithm by one measurement: the sensitivities hold nearby."""
_STRAIGHTEST, _MOST_BENT = 0.02, 4.5
_TRACKER_NOISE = 0.01  # rad, with what the model cannot explain
# s by which model and tracker may be apart: a measurement counts little while the tip darts.
_TIMING = 0.02
# Standard deviation of the change of ``log(capstan_exponent)`` in one second.
_DRIFT = 0.03
# So many innovations in a row beyond so many standard deviations say that the tube has changed; s
# from one such moment to the next: tubes are not bent all the time.
_SURPRISES, _SURPRISE, _RESET_PAUSE = 3, 3.5, 12.0
# s over which misfit is averaged; what stays unexplained makes the tracker count for less.
_DOUBT_TIME = 2.0


class PlantLearning:
    """Recursive prediction-error estimator of one joint (Ljung 1999, section 11.4).

    A model of the plant behind its servo predicts the tip; copies with one parameter moved by 2 %
    each give the sensitivities. `gear` is the shaft angle for one radian of a command, `shafts` are
    the turning points in rad of the shaft so far, from rest at zero to where it is.
    """

    _STEP = 0.02
    _HISTORY = 0.5
    _FARTHEST = 0.5

    def __init__(
        self,
        parameters: PhysicalParameters,
        gear: float,
        shafts: Sequence[float] = (0.0,),
    ) -> None:
        self.parameters = parameters  # as estimated
        self._first = parameters
        self._names = tuple(LEARNT)
        self._logs = np.zeros(len(LEARNT))
        self.covariance = np.diag(np.array(list(LEARNT.values())) ** 2)
        self._gear = gear
        self._turns = TurningPoints(shafts)
        self._speed = 0.0
        packed, on = packed_joint(parameters.joint)
        models = (len(LEARNT) + 1, 1)
        self._packed, on = np.tile(packed, models), np.tile(on, models)
        self._places = [NOMINAL_KEYS.index(name) for name in LEARNT]
        self._nominal = packed[self._places]
        at_rest = rest_state(self._packed, on, TICK)
        self._states = at_rest[0]
        self._models = (*at_rest, self._packed, on, np.zeros(INPUTS))
        # As last set up in the models, which follow the estimates by notable steps.
        self.modelled = parameters
        self._modelled_logs = self._logs
        self._go_through_turns()
        self._time = 0.0
        self._last = -math.inf
        self._history: deque[tuple[float, Array]] = deque()
        self._surprises = 0
        self._last_reset = -math.inf
        self._unexplained = 1.0

    @property
    def tip(self) -> float:
        """Bending angle predicted for now, rad."""
        return float(self._states[0, JOINT])

    def sent(self, command: float, dt: float) -> None:
        """Advance the models by a command (rad) in force for `dt` s."""
        joint = self._first.joint
        goal = self._gear * command
        a11, a12, a21, a22 = transition(joint.motor_bandwidth, joint.motor_damping_ratio, dt)
        behind = self._turns.values[-1] - goal
        shaft = goal + a11 * behind + a12 * self._speed
        self._speed = a21 * behind + a22 * self._speed
        self._turns.follow(shaft)
        turn_all(self._models, shaft, dt)
        self._time += dt
        self._history.append((self._time, self._states[:, JOINT].copy()))
        while self._history[0][0] < self._time - self._HISTORY:
            self._history.popleft()

    def measured(self, age: float, angle: float) -> PhysicalParameters:
        """Learn from a bending angle (rad) that held `age` s ago; return the parameters now.

        A measurement older than half a second or than the last one is left out.
        """
        time = self._time - age
        found = self._at(time)
        if found is None or time <= self._last:
            return self.parameters
        # Recursive least squares with a prior, and a random walk of the capstan exponent instead of
        # forgetting, so that what motion does not excite is kept.
        elapsed = min(1.0, time - self._last)
        self._last = time
        tips, speed = found
        sensitivity = (tips[1:] - tips[0]) / self._STEP
        self.covariance[0, 0] += _DRIFT**2 * elapsed
        noise = _TRACKER_NOISE**2 + (_TIMING * speed) ** 2
        noise *= self._unexplained
        innovation = angle - tips[0]
        self._watch(innovation, sensitivity, noise, elapsed)
        gain_side = self.covariance @ sensitivity
        spread = noise + float(sensitivity @ gain_side)
        # A single reading may not move the estimates by more than three deviations (Huber).
        limit = 3.0 * math.sqrt(spread)
        bounded = min(limit, max(-limit, innovation))
        step = gain_side / spread * bounded
        self._logs = self._logs + step * min(1.0, _LARGEST_STEP / max(np.max(np.abs(step)), 1e-9))
        covariance = self.covariance - np.outer(gain_side, gain_side) / spread
        self.covariance = 0.5 * (covariance + covariance.T)
        self._bound()
        self._take()
        return self.parameters

    def _watch(self, innovation: float, sensitivity: Array, noise: float, elapsed: float) -> None:
        spread = noise + float(sensitivity @ self.covariance @ sensitivity)
        # Misfit that stays is physics that the model lacks, not a parameter: believe less.
        grown = self._unexplained * innovation**2 / spread
        weight = min(1.0, elapsed / _DOUBT_TIME)
        self._unexplained = max(1.0, self._unexplained + weight * (grown - self._unexplained))
        self._surprises = self._surprises + 1 if innovation**2 > _SURPRISE**2 * spread else 0
        if self._surprises >= _SURPRISES and self._time - self._last_reset > _RESET_PAUSE:
            self._surprises = 0
            self._last_reset = self._time
            self._unexplained = 1.0
            # Covariance resetting (Goodwin and Sin 1984, section 3.3): the tube has been bent.
            self.covariance[0, :] = self.covariance[:, 0] = 0.0
            self.covariance[0, 0] = _BENT_ANEW**2

    def _at(self, time: float) -> tuple[Array, float] | None:
        """Tips that were predicted for `time` and the speed of the first, None if unknown."""
        for k in range(len(self._history) - 1, 0, -1):
            stamp, tips = self._history[k]
            before, earlier = self._history[k - 1]
            if before < time <= stamp:
                weight = (time - before) / (stamp - before)
                speed = abs(float(tips[0] - earlier[0])) / (stamp - before)
                return earlier + weight * (tips - earlier), speed
        return None

    def _bound(self) -> None:
        first = self._first.joint.capstan_exponent
        low = np.full(len(self._names), -self._FARTHEST)
        high = -low
        low[0], high[0] = math.log(_STRAIGHTEST / first), math.log(_MOST_BENT / first)
        self._logs = np.clip(self._logs, low, high)

    def _take(self) -> None:
        self.parameters = PhysicalParameters(self._scaled(self._logs))
        if np.max(np.abs(self._logs - self._modelled_logs)) < NOTABLE:
            return
        # All copies go through the shaft's turning points again, to where their plants would be.
        self.modelled, self._modelled_logs = self.parameters, self._logs
        self._go_through_turns()

    def _go_through_turns(self) -> None:
        self._packed[:, self._places] = self._nominal * np.exp(self._logs)
        for i, place in enumerate(self._places):
            self._packed[i + 1, place] *= math.exp(self._STEP)
        path = np.array(self._turns.values)
        go_through_shafts(self._models, path)

    def _scaled(self, logs: Array) -> JointParameters:
        first = self._first.joint
        changes = {
            name: getattr(first, name) * math.exp(log)
            for name, log in zip(self._names, logs.tolist(), strict=True)
        }
        return replace(first, **changes)
