"""Parameters of the inverse, chosen for the least tracking error on an identified model.

The paper puts the parameters of the transmission straight into equation 5; but there `h` is driven
by the desired angle instead of the motor's, which is further by the very dead zone that is to be
crossed, so that the state turns too late at every reversal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from endoscope_core.hysteresis import (
    BoucWenParameters,
    DahlParameters,
    HysteresisParameters,
    direct_inverse,
    forward,
)
from endoscope_core.hysteresis.memory_model import (
    GREATEST_ALPHA,
    GREATEST_INVERSE_SLOPE,
    GREATEST_LAG,
    SMALLEST_ALPHA,
)
from endoscope_core.physics import JointParameters
from endoscope_core.signals import Signal, sum_of_sines
from endoscope_core.signals.motions import teleoperation_like

_RHO = -0.9
# Parameters rounded for a file must still pass the limit.
_SLOPE = 0.99 * GREATEST_INVERSE_SLOPE

Bounds = list[tuple[float, float]]
Array = NDArray[np.float64]

_STEP = 0.004
_DEG = float(np.pi / 180.0)


@dataclass(frozen=True)
class Servo:
    """Bandwidth in rad/s and damping ratio of the position loop."""

    bandwidth: float = JointParameters.motor_bandwidth
    damping_ratio: float = JointParameters.motor_damping_ratio

    @property
    def lag(self) -> float:
        """Time in s by which it follows a steady motion late."""
        return 2.0 * self.damping_ratio / self.bandwidth

    def answer(self, command: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        """Motor angle (N,) for a command (N,) held for `dt` s each, beginning at rest on it."""
        # A node imports this module and never asks: scipy.signal is 26 MB of its memory.
        from scipy.signal import lfilter

        numerator, denominator = _filter(self.bandwidth, self.damping_ratio, dt)
        start = command[0]
        moved: NDArray[np.float64] = lfilter(numerator, denominator, command - start)
        return start + moved


@lru_cache
def _filter(w: float, z: float, dt: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    from scipy.signal import cont2discrete

    numerator, denominator, _ = cont2discrete(([w * w], [1.0, 2.0 * z * w, w * w]), dt)
    return numerator[0], denominator


@dataclass(frozen=True)
class Candidates:
    """A box, and the parameters that `make` makes of a point of it: safe for every point."""

    bounds: Bounds
    make: Callable[[Sequence[float]], HysteresisParameters]


def candidates_for(model: HysteresisParameters) -> Candidates:
    """Inverses to choose from for an identified model.

    The steeper the inverse, the better it crosses the dead zone; it is therefore nearly as steep as
    its class allows, and the travel follows from that, so that every candidate is safe by
    construction. Gain, lag and sharpness are free; the offset is the model's. `rho` hardly
    matters and is kept where the state leaves saturation gently.
    """
    gain_and_lag = [
        (max(0.7 * model.alpha, SMALLEST_ALPHA), min(1.4 * model.alpha, GREATEST_ALPHA)),
        (0.01, min(2.5 * model.lag + 0.2, GREATEST_LAG)),
    ]
    if isinstance(model, BoucWenParameters):
        return Candidates([*gain_and_lag, (1.0, 4.0)], _bouc_wen)
    return Candidates([*gain_and_lag, (0.6, 3.0)], lambda x: _dahl(x, model.offset))


def _bouc_wen(x: Sequence[float]) -> BoucWenParameters:
    alpha, lag, n = x
    return BoucWenParameters.from_shape(alpha, lag, lag / (alpha * _SLOPE - 1.0), _RHO, n)


def _dahl(x: Sequence[float], offset: float) -> DahlParameters:
    alpha, lag, exponent = x
    travel = 2.0**exponent * lag / (alpha * _SLOPE - 1.0)
    return DahlParameters(alpha, lag, travel, exponent, offset)


@dataclass(frozen=True)
class FeedforwardFit:
    """Parameters for the inverse: equation 5 of the first paper or another model's; rad."""

    parameters: HysteresisParameters
    rmse: float  # rad that the feed-forward leaves on the identified model
    uncompensated_rmse: float  # rad without it


def design_motions() -> list[Signal]:
    """Motions that the feed-forward is fitted on: small and large, regular and not."""
    return [
        sum_of_sines('small', [(35.0 * _DEG, 1.2)], 12.0),
        sum_of_sines('large', [(75.0 * _DEG, 0.8)], 16.0),
        teleoperation_like(5, 8, 70.0 * _DEG),
    ]


def fit_feedforward(
    model: HysteresisParameters, servo: Servo, lead: float, seed: int = 0
) -> FeedforwardFit:
    """Choose the parameters of the inverse for the least tracking error on an identified model.

    The servo is between command and motor; `lead` in s is the compensator's.
    """
    cases = [_Case.of(signal, lead) for signal in design_motions()]

    def error(candidate: HysteresisParameters | None) -> float:
        squares = [case.errors(candidate, model, servo) ** 2 for case in cases]
        return float(np.mean(np.concatenate(squares)))

    candidates = candidates_for(model)
    found = differential_evolution(
        lambda x: error(candidates.make(x.tolist())),
        candidates.bounds,
        rng=np.random.default_rng(seed),
        popsize=6,
        maxiter=30,
        tol=1e-4,
        polish=False,
    )
    return FeedforwardFit(
        candidates.make(found.x.tolist()), float(np.sqrt(found.fun)), float(np.sqrt(error(None)))
    )


@dataclass(frozen=True)
class _Case:
    desired: Array
    foreseen: Array
    scored: NDArray[np.bool_]

    @classmethod
    def of(cls, signal: Signal, lead: float) -> _Case:
        time = np.arange(0.0, signal.duration, _STEP)
        angle, velocity = signal(time)
        # What happens before the first reversal depends on where the joint had come from.
        scored = (time >= max(signal.steady[0], 1.5)) & (time <= signal.steady[1])
        return cls(angle, angle + lead * velocity, scored)

    def errors(
        self, candidate: HysteresisParameters | None, model: HysteresisParameters, servo: Servo
    ) -> Array:
        command = self.desired if candidate is None else direct_inverse(candidate, self.foreseen)
        reached = forward(model, servo.answer(command, _STEP))
        return (reached - self.desired)[self.scored]
