"""Parameters between two sets, as safe as both."""

from __future__ import annotations

import math
from itertools import zip_longest

from endoscope_core.choices import PHYSICAL
from endoscope_core.control.feedforward import LawParameters
from endoscope_core.control.physical_parameters import PhysicalParameters
from endoscope_core.hysteresis import (
    AsymmetricBoucWenParameters,
    BoucWenParameters,
    DahlParameters,
    PlayParameters,
    PrandtlIshlinskiiParameters,
)
from endoscope_core.hysteresis.inverse import MODELS
from endoscope_core.physics import JointParameters
from endoscope_core.physics.family import SIGNED
from endoscope_core.physics.layout import NOMINAL_KEYS

KINDS: dict[str, type[LawParameters]] = {**MODELS, PHYSICAL: PhysicalParameters}
"""Kind of parameters by the name of the model; 'physical' is the plant itself."""

_NO_LAG = 1e-12


def blend(first: LawParameters, second: LawParameters, weight: float) -> LawParameters:
    """Parameters at `weight` in [0, 1] of the way from one set to another of the same kind.

    Gains, lags, offsets and the steepness ``slope alpha - 1`` are interpolated, not the travels:
    the slope of the inverse, a quotient of two linear functions, then lies between those of the two
    sets. Parameters of the plant are interpolated by their logarithms.

    Raises
    ------
    ValueError
        If the kinds differ or the weight is out of range.
    """
    if not 0.0 <= weight <= 1.0:
        raise ValueError(f'weight = {weight} must lie in [0, 1]')
    if weight in (0.0, 1.0):
        return second if weight else first
    if isinstance(first, BoucWenParameters) and isinstance(second, BoucWenParameters):
        alpha, lag, steepness, rho, n = _between(
            _bouc_wen_point(first), _bouc_wen_point(second), weight
        )
        travel = _travel(lag, max(1.0, 1.0 + rho), steepness)
        return BoucWenParameters.from_shape(alpha, lag, travel, rho, n)
    if isinstance(first, DahlParameters) and isinstance(second, DahlParameters):
        alpha, lag, steepness, exponent, offset = _between(
            _dahl_point(first), _dahl_point(second), weight
        )
        return DahlParameters(alpha, lag, _travel(lag, 2.0**exponent, steepness), exponent, offset)
    if isinstance(first, PlayParameters) and isinstance(second, PlayParameters):
        alpha, lag, steepness, offset = _between(
            (first.alpha, first.lag, first.lag / first.travel, first.offset),
            (second.alpha, second.lag, second.lag / second.travel, second.offset),
            weight,
        )
        return PlayParameters(alpha, lag, _travel(lag, 1.0, steepness), offset)
    if isinstance(first, AsymmetricBoucWenParameters) and isinstance(
        second, AsymmetricBoucWenParameters
    ):
        return _asymmetric(_between(_asymmetric_point(first), _asymmetric_point(second), weight))
    if isinstance(first, PrandtlIshlinskiiParameters) and isinstance(
        second, PrandtlIshlinskiiParameters
    ):
        return PrandtlIshlinskiiParameters(
            tuple(_between(first.thresholds, second.thresholds, weight)),
            tuple(_between(first.weights, second.weights, weight)),
            _between((first.offset,), (second.offset,), weight)[0],
        )
    if isinstance(first, PhysicalParameters) and isinstance(second, PhysicalParameters):
        return PhysicalParameters(blend_joints(first.joint, second.joint, weight))
    raise ValueError(f'{type(first).__name__} and {type(second).__name__} cannot be blended')


Point = tuple[float, ...]


def blend_joints(first: JointParameters, second: JointParameters, weight: float) -> JointParameters:
    """Joint at `weight` in [0, 1] between two: by logarithms, straight what may have any sign."""
    blended = {}
    for key in NOMINAL_KEYS:
        a, b = getattr(first, key), getattr(second, key)
        blended[key] = a + weight * (b - a) if key in SIGNED else _geometric(a, b, weight)
    pairs = zip_longest(first.friction_profile, second.friction_profile, fillvalue=0.0)
    profile = tuple(a + weight * (b - a) for a, b in pairs)
    return JointParameters(**blended, friction_profile=profile)


def _between(first: Point, second: Point, weight: float) -> list[float]:
    return [a + weight * (b - a) for a, b in zip(first, second, strict=True)]


def _geometric(first: float, second: float, weight: float) -> float:
    """Between two numbers by their logarithms, or straight where one of them is zero."""
    if first > 0.0 and second > 0.0:
        return math.exp(math.log(first) + weight * (math.log(second) - math.log(first)))
    return first + weight * (second - first)


def _travel(lag: float, steepest: float, steepness: float) -> float:
    return steepest * lag / steepness if steepness > _NO_LAG else 1.0


def _bouc_wen_point(p: BoucWenParameters) -> Point:
    return p.alpha, p.lag, p.inverse_slope * p.alpha - 1.0, p.rho, p.n


def _dahl_point(p: DahlParameters) -> Point:
    return p.alpha, p.lag, p.inverse_slope * p.alpha - 1.0, p.exponent, p.offset


def _asymmetric_point(p: AsymmetricBoucWenParameters) -> Point:
    widest = p.lag + 1.75 * abs(p.skew)
    return (
        p.alpha,
        p.lag,
        p.skew,
        p.offset,
        max(1.0, 1.0 + p.rho_up) * widest / p.travel_up,
        p.rho_up,
        p.n_up,
        max(1.0, 1.0 + p.rho_down) * widest / p.travel_down,
        p.rho_down,
        p.n_down,
    )


def _asymmetric(point: list[float]) -> AsymmetricBoucWenParameters:
    alpha, lag, skew, offset, steep_up, rho_up, n_up, steep_down, rho_down, n_down = point
    widest = lag + 1.75 * abs(skew)
    return AsymmetricBoucWenParameters(
        alpha,
        lag,
        skew,
        offset,
        _travel(widest, max(1.0, 1.0 + rho_up), steep_up),
        rho_up,
        n_up,
        _travel(widest, max(1.0, 1.0 + rho_down), steep_down),
        rho_down,
        n_down,
    )
