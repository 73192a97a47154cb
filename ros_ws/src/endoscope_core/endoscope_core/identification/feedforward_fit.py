"""Parameters of the feed-forward that makes an identified transmission follow."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from endoscope_core.hysteresis import BoucWenParameters, bouc_wen_forward, bouc_wen_inverse
from endoscope_core.hysteresis.bouc_wen import GREATEST_INVERSE_SLOPE, GREATEST_LAG
from endoscope_core.identification.servo_lag import Servo
from endoscope_core.signals import Signal, sum_of_sines
from endoscope_core.signals.commissioning import teleoperation_like

Array = NDArray[np.float64]

_STEP = 0.004
_RHO = -0.9
# Parameters rounded for a file must still pass the limit.
_SLOPE = 0.99 * GREATEST_INVERSE_SLOPE
_DEG = float(np.pi / 180.0)


@dataclass(frozen=True)
class FeedforwardFit:
    """Parameters for equation 5.

    Parameters
    ----------
    parameters : BoucWenParameters
    rmse : float
        rad that the feed-forward leaves on the identified model.
    uncompensated_rmse : float
        rad without it.
    """

    parameters: BoucWenParameters
    rmse: float
    uncompensated_rmse: float


def design_motions() -> list[Signal]:
    """Motions that the feed-forward is fitted on: small and large, regular and not."""
    return [
        sum_of_sines('small', [(35.0 * _DEG, 1.2)], 12.0),
        sum_of_sines('large', [(75.0 * _DEG, 0.8)], 16.0),
        teleoperation_like(5, 8, 70.0 * _DEG),
    ]


def fit_feedforward(
    model: BoucWenParameters, servo: Servo, lead: float, seed: int = 0
) -> FeedforwardFit:
    """Choose the parameters of equation 5 for the least tracking error on an identified model.

    The search (differential evolution, as for the model) runs over `alpha`, lag and `n` within a
    box. The steeper the inverse, the better it crosses the dead zone; it is therefore nearly as
    steep as `BoucWenParameters` allows, and the travel follows from that, so that every candidate
    is safe by construction. `rho` hardly matters and is kept where the state leaves saturation
    gently.

    Parameters
    ----------
    model : BoucWenParameters
        Of the transmission, from `fit_model`.
    servo : Servo
        Between command and motor.
    lead : float
        s, of the compensator (`FeedforwardSettings.lead`).
    seed : int
        Of the search.
    """
    cases = [_Case.of(signal, lead) for signal in design_motions()]

    def error(candidate: BoucWenParameters | None) -> float:
        squares = [case.errors(candidate, model, servo) ** 2 for case in cases]
        return float(np.mean(np.concatenate(squares)))

    reach = min(2.5 * model.lag + 0.2, GREATEST_LAG)
    bounds = [(0.7 * model.alpha, 1.4 * model.alpha), (0.01, reach), (1.0, 4.0)]
    found = differential_evolution(
        lambda x: error(_candidate(x)),
        bounds,
        rng=np.random.default_rng(seed),
        popsize=6,
        maxiter=30,
        tol=1e-4,
        polish=False,
    )
    return FeedforwardFit(
        _candidate(found.x), float(np.sqrt(found.fun)), float(np.sqrt(error(None)))
    )


def _candidate(x: Array) -> BoucWenParameters:
    alpha, lag, n = (float(value) for value in x)
    travel = lag / (alpha * _SLOPE - 1.0)
    return BoucWenParameters.from_shape(alpha, lag, travel, _RHO, n)


@dataclass(frozen=True)
class _Case:
    desired: Array
    foreseen: Array
    scored: NDArray[np.bool_]

    @classmethod
    def of(cls, signal: Signal, lead: float) -> '_Case':
        time = np.arange(0.0, signal.duration, _STEP)
        angle, velocity = signal(time)
        # What happens before the first reversal depends on where the joint had come from.
        scored = (time >= max(signal.steady[0], 1.5)) & (time <= signal.steady[1])
        return cls(angle, angle + lead * velocity, scored)

    def errors(
        self, candidate: BoucWenParameters | None, model: BoucWenParameters, servo: Servo
    ) -> Array:
        command = self.desired if candidate is None else bouc_wen_inverse(candidate, self.foreseen)
        reached = bouc_wen_forward(model, servo.answer(command, _STEP))
        return (reached - self.desired)[self.scored]
