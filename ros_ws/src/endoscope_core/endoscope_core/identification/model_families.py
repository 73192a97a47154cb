"""Each hysteresis model as a shape that is searched and factors that follow linearly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.hysteresis import (
    AsymmetricBoucWenParameters,
    BoucWenParameters,
    DahlParameters,
    PlayParameters,
)
from endoscope_core.hysteresis.asymmetric_bouc_wen_kernel import asymmetric_path
from endoscope_core.hysteresis.bouc_wen_kernel import bouc_wen_normalised_path
from endoscope_core.hysteresis.dahl_kernel import dahl_path, play_path
from endoscope_core.hysteresis.inverse_safety import (
    GREATEST_ALPHA,
    GREATEST_INVERSE_SLOPE,
    GREATEST_LAG,
    GREATEST_OFFSET,
    SMALLEST_ALPHA,
)

Array = NDArray[np.float64]
MemoryParameters = BoucWenParameters | AsymmetricBoucWenParameters | DahlParameters | PlayParameters

SHORTEST_TRAVEL = float(np.deg2rad(2.0))
LONGEST_TRAVEL = float(np.deg2rad(90.0))
TRAVEL_BOUNDS = (float(np.log(SHORTEST_TRAVEL)), float(np.log(LONGEST_TRAVEL)))
RHO_BOUNDS = (-0.95, 1.0)
EXPONENT_BOUNDS = (1.0, 4.0)
LAG_BOUNDS = (0.0, GREATEST_LAG)
ALPHA_BOUNDS = (SMALLEST_ALPHA, GREATEST_ALPHA)
# What is rounded for a file must still pass the limit.
_SLOPE = 0.99 * GREATEST_INVERSE_SLOPE


@dataclass(frozen=True)
class ModelFamily:
    """How a model is fitted by variable projection (Golub and Pereyra 1973)."""

    shape_bounds: tuple[tuple[float, float], ...]  # of the parameters that are searched
    linear_bounds: tuple[tuple[float, float], ...]  # of the factors of `columns`
    path: Callable[[Array, float, Array], Array]  # from driver, y0 and shape to y (N,)
    columns: Callable[[Array, Array], Array]  # from driver and y to (N, K)
    # From shape, factors and offset; safe whatever they are within their bounds: where the inverse
    # would be too steep, the travel is lengthened.
    build: Callable[[Array, Array, float], MemoryParameters]
    has_offset: bool  # of the model itself


def _two_columns(driver: Array, y: Array) -> Array:
    return np.stack([driver, -y], axis=1)


def _travel(log_travel: float, alpha: float, lag: float, steepest: float) -> float:
    """Travel that was searched, or the shortest that keeps the inverse's slope."""
    return float(max(np.exp(log_travel), steepest * lag / (_SLOPE * alpha - 1.0)))


def _bouc_wen(shape: Array, factors: Array, offset: float) -> BoucWenParameters:
    (alpha, lag), rho = factors.tolist(), float(shape[1])
    travel = _travel(shape[0], alpha, lag, max(1.0, 1.0 + rho))
    return BoucWenParameters.from_shape(alpha, lag, travel, rho, float(shape[2]))


def _dahl(shape: Array, factors: Array, offset: float) -> DahlParameters:
    (alpha, lag), exponent = factors.tolist(), float(shape[1])
    travel = _travel(shape[0], alpha, lag, 2.0**exponent)
    return DahlParameters(alpha, lag, travel, exponent, _bounded(offset))


def _play(shape: Array, factors: Array, offset: float) -> PlayParameters:
    alpha, lag = factors.tolist()
    return PlayParameters(alpha, lag, _travel(shape[0], alpha, lag, 1.0), _bounded(offset))


def _asymmetric(shape: Array, factors: Array, offset: float) -> AsymmetricBoucWenParameters:
    alpha, lag, skew = factors.tolist()
    skew = float(np.clip(skew, -0.45 * alpha, 0.45 * alpha))
    widest = lag + 1.75 * abs(skew)
    room = _SLOPE * alpha - 1.0 - abs(skew)
    travels = [
        float(max(np.exp(shape[k]), max(1.0, 1.0 + shape[k + 1]) * widest / room)) for k in (0, 3)
    ]
    rho_up, n_up, rho_down, n_down = (float(shape[k]) for k in (1, 2, 4, 5))
    return AsymmetricBoucWenParameters(
        alpha,
        lag,
        skew,
        _bounded(offset),
        travels[0],
        rho_up,
        n_up,
        travels[1],
        rho_down,
        n_down,
    )


def _bounded(offset: float) -> float:
    return float(np.clip(offset, -GREATEST_OFFSET, GREATEST_OFFSET))


FAMILIES: dict[str, ModelFamily] = {
    'bouc_wen': ModelFamily(
        (TRAVEL_BOUNDS, RHO_BOUNDS, EXPONENT_BOUNDS),
        (ALPHA_BOUNDS, LAG_BOUNDS),
        lambda driver, y0, s: bouc_wen_normalised_path(driver, y0, np.exp(s[0]), s[1], s[2]),
        _two_columns,
        _bouc_wen,
        has_offset=False,
    ),
    'asymmetric_bouc_wen': ModelFamily(
        (TRAVEL_BOUNDS, RHO_BOUNDS, EXPONENT_BOUNDS) * 2,
        (ALPHA_BOUNDS, LAG_BOUNDS, (-0.3, 0.3)),
        lambda driver, y0, s: asymmetric_path(
            driver, y0, (np.exp(s[0]), s[1], s[2]), (np.exp(s[3]), s[4], s[5])
        ),
        lambda driver, y: np.stack([driver, -y, -driver * y], axis=1),
        _asymmetric,
        has_offset=True,
    ),
    'dahl': ModelFamily(
        (TRAVEL_BOUNDS, (0.5, 4.0)),
        (ALPHA_BOUNDS, LAG_BOUNDS),
        lambda driver, y0, s: dahl_path(driver, y0, np.exp(s[0]), s[1]),
        _two_columns,
        _dahl,
        has_offset=True,
    ),
    'play': ModelFamily(
        (TRAVEL_BOUNDS,),
        (ALPHA_BOUNDS, LAG_BOUNDS),
        lambda driver, y0, s: play_path(driver, y0, np.exp(s[0])),
        _two_columns,
        _play,
        has_offset=True,
    ),
}
"""The models with one memory. The play's travel is free: where it is not ``lag / alpha`` the sides
of the gap are joined by a slope, which real wires have."""
