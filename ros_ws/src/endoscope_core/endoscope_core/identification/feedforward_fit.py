"""Parameters of the feed-forward that makes an identified transmission follow."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from endoscope_core.hysteresis import (
    PrandtlIshlinskiiParameters,
    direct_inverse,
    forward,
    prandtl_ishlinskii_forward,
    prandtl_ishlinskii_inverse,
)
from endoscope_core.hysteresis.inverse import HysteresisParameters
from endoscope_core.identification.feedforward_candidates import candidates_for
from endoscope_core.identification.servo_lag import Servo
from endoscope_core.signals import Signal, sum_of_sines
from endoscope_core.signals.commissioning import teleoperation_like

Array = NDArray[np.float64]

_STEP = 0.004
_DEG = float(np.pi / 180.0)


@dataclass(frozen=True)
class FeedforwardFit:
    """Parameters for the inverse: equation 5 of the first paper, or that of another model.

    Parameters
    ----------
    parameters : HysteresisParameters
    rmse : float
        rad that the feed-forward leaves on the identified model.
    uncompensated_rmse : float
        rad without it.
    """

    parameters: HysteresisParameters
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
    model: HysteresisParameters, servo: Servo, lead: float, seed: int = 0
) -> FeedforwardFit:
    """Choose the parameters of the inverse for the least tracking error on an identified model.

    The search (differential evolution, as for the model) runs over the box of `candidates_for`, in
    which every point is safe.

    Parameters
    ----------
    model : HysteresisParameters
        Of the transmission, from `fit_model`.
    servo : Servo
        Between command and motor.
    lead : float
        s, of the compensator (`FeedforwardSettings.lead`).
    seed : int
        Of the search.
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


def _inverse(parameters: HysteresisParameters, desired: Array) -> Array:
    if isinstance(parameters, PrandtlIshlinskiiParameters):
        return prandtl_ishlinskii_inverse(parameters, desired)
    return direct_inverse(parameters, desired)


def _forward(parameters: HysteresisParameters, driver: Array) -> Array:
    if isinstance(parameters, PrandtlIshlinskiiParameters):
        return prandtl_ishlinskii_forward(parameters, driver)
    return forward(parameters, driver)


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
        self, candidate: HysteresisParameters | None, model: HysteresisParameters, servo: Servo
    ) -> Array:
        command = self.desired if candidate is None else _inverse(candidate, self.foreseen)
        reached = _forward(model, servo.answer(command, _STEP))
        return (reached - self.desired)[self.scored]
