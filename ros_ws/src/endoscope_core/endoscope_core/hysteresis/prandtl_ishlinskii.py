"""Prandtl-Ishlinskii hysteresis: a weighted sum of plays, with an exact analytic inverse."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.compiled import njit
from endoscope_core.hysteresis.memory_model import (
    GREATEST_ALPHA,
    GREATEST_INVERSE_SLOPE,
    GREATEST_OFFSET,
    check_numbers,
    check_range,
)

SMALLEST_FIRST_WEIGHT = 1.0 / GREATEST_INVERSE_SLOPE
LONGEST_THRESHOLD = 3.0


@njit(cache=True)
def play_stack_step(
    thresholds: NDArray[np.float64], plays: NDArray[np.float64], driver: float
) -> NDArray[np.float64]:
    """Outputs (M,) of plays of the given thresholds (M,) after a monotone move to `driver`."""
    return np.minimum(driver + thresholds, np.maximum(driver - thresholds, plays))


@njit(cache=True)
def play_stack_path(
    thresholds: NDArray[np.float64], driver: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Outputs (N, M) along a driving angle (N,), from `start` (M,)."""
    states = np.empty((driver.size, thresholds.size))
    plays = start
    for k in range(driver.size):
        plays = play_stack_step(thresholds, plays, driver[k])
        states[k] = plays
    return states


@dataclass(frozen=True)
class PrandtlIshlinskiiParameters:
    """``theta_a = offset + sum_i w_i p_i``, `p_i` the play of threshold `r_i`, all in rad.

    Weights that are not negative make the model monotone, and then its inverse is of the same form
    (Krejci and Kuhnen 2001): thresholds and weights follow in closed form, nothing is iterated. The
    play of threshold zero passes its input; its weight is the least slope of the model, so that
    ``1 / w_0`` is the greatest slope of the inverse.

    ValueError if lengths differ, thresholds do not increase from zero, or a weight is out of range.
    """

    thresholds: tuple[float, ...]  # rad, increasing from 0
    weights: tuple[float, ...]  # dimensionless, not negative; the first at least 1/40
    offset: float = 0.0  # rad

    def __post_init__(self) -> None:
        name = 'Prandtl-Ishlinskii'
        numbers = {f'threshold {k}': r for k, r in enumerate(self.thresholds)}
        numbers |= {f'weight {k}': w for k, w in enumerate(self.weights)}
        check_numbers(name, numbers | {'offset': self.offset})
        if len(self.thresholds) != len(self.weights) or not self.weights:
            raise ValueError(
                f'{name}: {len(self.thresholds)} thresholds and {len(self.weights)} weights '
                'must be equally many, and at least one'
            )
        if self.thresholds[0] != 0.0 or np.any(np.diff(self.thresholds) <= 0.0):
            raise ValueError(f'{name} thresholds must increase from 0')
        check_range(name, 'last threshold', self.thresholds[-1], 0.0, LONGEST_THRESHOLD)
        check_range(name, 'offset', self.offset, -GREATEST_OFFSET, GREATEST_OFFSET)
        if min(self.weights) < 0.0:
            raise ValueError(f'{name} weights must not be negative, one is {min(self.weights):g}')
        check_range(
            name,
            'first weight',
            self.weights[0],
            SMALLEST_FIRST_WEIGHT * (1.0 - 1e-9),
            GREATEST_ALPHA,
        )
        check_range(name, 'sum of weights', sum(self.weights), 0.2, GREATEST_ALPHA * 1.000001)

    @cached_property
    def stack(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Thresholds (rad) and weights of the plays."""
        return np.array(self.thresholds), np.array(self.weights)

    @cached_property
    def inverse_stack(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Thresholds and weights of the exact inverse (Krejci and Kuhnen 2001, section 3)."""
        r, w = self.stack
        total = np.cumsum(w)
        thresholds = np.array(
            [float(np.sum(w[: j + 1] * (r[j] - r[: j + 1]))) for j in range(r.size)]
        )
        weights = np.empty(r.size)
        weights[0] = 1.0 / w[0]
        weights[1:] = -w[1:] / (total[1:] * total[:-1])
        return thresholds, weights

    @property
    def inverse_slope(self) -> float:
        """Greatest slope of the inverse."""
        return 1.0 / self.weights[0]

    def to_dict(self) -> dict[str, Any]:
        """The parameters by name."""
        return {
            'thresholds': list(self.thresholds),
            'weights': list(self.weights),
            'offset': self.offset,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> PrandtlIshlinskiiParameters:
        """Parameters from a mapping of exactly their names; ValueError otherwise."""
        if set(values) != {'thresholds', 'weights', 'offset'}:
            raise ValueError(
                'Prandtl-Ishlinskii parameters must be exactly offset, thresholds, weights, not '
                + ', '.join(sorted(values))
            )
        return cls(
            tuple(float(r) for r in values['thresholds']),
            tuple(float(w) for w in values['weights']),
            float(values['offset']),
        )


def play_states(
    thresholds: NDArray[np.float64], driver: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Outputs (N, M) of M plays along a driving angle (N,); (M,) `start` before the first."""
    states: NDArray[np.float64] = play_stack_path(thresholds, driver, start)
    return states


def prandtl_ishlinskii_forward(
    parameters: PrandtlIshlinskiiParameters, theta: ArrayLike
) -> NDArray[np.float64]:
    """Actual angle (N,) for a driving angle (N,) in rad, from rest at zero."""
    thresholds, weights = parameters.stack
    driver = np.ascontiguousarray(theta, dtype=float)
    states = play_states(thresholds, driver, np.zeros(thresholds.size))
    result: NDArray[np.float64] = parameters.offset + states @ weights
    return result


def prandtl_ishlinskii_inverse(
    parameters: PrandtlIshlinskiiParameters, theta_d: ArrayLike
) -> NDArray[np.float64]:
    """Command (N,) whose actual angle is the desired one (N,), from rest at zero."""
    thresholds, weights = parameters.inverse_stack
    driver = np.ascontiguousarray(theta_d, dtype=float) - parameters.offset
    states = play_states(thresholds, driver, np.zeros(thresholds.size))
    result: NDArray[np.float64] = states @ weights
    return result


def saturated_plays(
    thresholds: NDArray[np.float64], driver: float, direction: float
) -> NDArray[np.float64]:
    """Outputs (M,) of plays that a long motion in `direction` (in [-1, 1]) brought to `driver`."""
    return driver - direction * thresholds


def advance_plays(
    thresholds: NDArray[np.float64], plays: NDArray[np.float64], driver: float
) -> NDArray[np.float64]:
    """Outputs (M,) after the driving angle has come to `driver`, monotonically; exact."""
    moved: NDArray[np.float64] = play_stack_step(thresholds, plays, driver)
    return moved
