"""For each model, the inverses among which a feed-forward is chosen, all of them safe."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from endoscope_core.hysteresis import (
    AsymmetricBoucWenParameters,
    BoucWenParameters,
    DahlParameters,
    PlayParameters,
    PrandtlIshlinskiiParameters,
)
from endoscope_core.hysteresis.inverse import HysteresisParameters
from endoscope_core.hysteresis.inverse_safety import (
    GREATEST_ALPHA,
    GREATEST_INVERSE_SLOPE,
    GREATEST_LAG,
    SMALLEST_ALPHA,
)
from endoscope_core.hysteresis.prandtl_ishlinskii import LONGEST_THRESHOLD, SMALLEST_FIRST_WEIGHT

_RHO = -0.9
# Parameters rounded for a file must still pass the limit.
_SLOPE = 0.99 * GREATEST_INVERSE_SLOPE

Bounds = list[tuple[float, float]]


@dataclass(frozen=True)
class Candidates:
    """A box, and the parameters that `make` makes of a point of it: safe for every point."""

    bounds: Bounds
    make: Callable[[Sequence[float]], HysteresisParameters]


def candidates_for(model: HysteresisParameters) -> Candidates:
    """Inverses to choose from for an identified model.

    The steeper the inverse, the better it crosses the dead zone; it is therefore nearly as steep as
    its class allows, and the travel follows from that, so that every candidate is safe by
    construction. Gain, lag and sharpness are free; offset and skew are the model's. `rho` hardly
    matters and is kept where the state leaves saturation gently.
    """
    if isinstance(model, PrandtlIshlinskiiParameters):
        # Its inverse is exact: only the scales of its weights and thresholds are free.
        return _play_stack(model)
    gain_and_lag = [
        (max(0.7 * model.alpha, SMALLEST_ALPHA), min(1.4 * model.alpha, GREATEST_ALPHA)),
        (0.01, min(2.5 * model.lag + 0.2, GREATEST_LAG)),
    ]
    if isinstance(model, BoucWenParameters):
        return Candidates([*gain_and_lag, (1.0, 4.0)], _bouc_wen)
    if isinstance(model, DahlParameters):
        return Candidates([*gain_and_lag, (0.6, 3.0)], lambda x: _dahl(x, model.offset))
    if isinstance(model, PlayParameters):
        return Candidates(gain_and_lag, lambda x: _play(x, model.offset))
    return Candidates([*gain_and_lag, (1.0, 4.0)], lambda x: _asymmetric(x, model))


def _bouc_wen(x: Sequence[float]) -> BoucWenParameters:
    alpha, lag, n = x
    return BoucWenParameters.from_shape(alpha, lag, lag / (alpha * _SLOPE - 1.0), _RHO, n)


def _dahl(x: Sequence[float], offset: float) -> DahlParameters:
    alpha, lag, exponent = x
    travel = 2.0**exponent * lag / (alpha * _SLOPE - 1.0)
    return DahlParameters(alpha, lag, travel, exponent, offset)


def _play(x: Sequence[float], offset: float) -> PlayParameters:
    alpha, lag = x
    return PlayParameters(alpha, lag, lag / (alpha * _SLOPE - 1.0), offset)


def _asymmetric(
    x: Sequence[float], model: AsymmetricBoucWenParameters
) -> AsymmetricBoucWenParameters:
    alpha, lag, n = x
    skew = min(0.45 * alpha, max(-0.45 * alpha, model.skew))
    travel = (lag + 1.75 * abs(skew)) / (alpha * _SLOPE - 1.0 - abs(skew))
    shape = travel, _RHO, n
    return AsymmetricBoucWenParameters(alpha, lag, skew, model.offset, *shape, *shape)


def _play_stack(model: PrandtlIshlinskiiParameters) -> Candidates:
    total = sum(model.weights)
    widest = LONGEST_THRESHOLD / max(model.thresholds[-1], 1e-9)

    def make(x: Sequence[float]) -> PrandtlIshlinskiiParameters:
        gain, width = x
        weights = [gain * weight for weight in model.weights]
        weights[0] = max(weights[0], SMALLEST_FIRST_WEIGHT)
        return PrandtlIshlinskiiParameters(
            tuple(width * threshold for threshold in model.thresholds),
            tuple(weights),
            model.offset,
        )

    gains = (max(0.7, 0.201 / total), max(0.8, min(1.4, 0.99 * GREATEST_ALPHA / total)))
    return Candidates([gains, (0.7, max(0.8, min(1.4, widest)))], make)
