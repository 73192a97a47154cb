"""Bounds within which every hysteresis model's inverse is safe to drive a motor with."""

import math
from collections.abc import Mapping
from typing import Any

SMALLEST_ALPHA = 0.2
GREATEST_ALPHA = 3.0
GREATEST_LAG = math.radians(120.0)
GREATEST_INVERSE_SLOPE = 40.0
GREATEST_OFFSET = math.radians(45.0)
_ROUNDING = 1.0 + 1e-9


def check_numbers(model: str, values: Mapping[str, Any]) -> None:
    """Refuse parameters that are not finite numbers: a ValueError names model and parameter."""
    for name, value in values.items():
        if not math.isfinite(value):
            raise ValueError(f'{model} parameter {name} is {value}: it must be a finite number')


def check_range(model: str, name: str, value: float, low: float, high: float) -> None:
    """Refuse a parameter out of ``[low, high]``: a ValueError names model, parameter and range."""
    if not low <= value <= high:
        raise ValueError(f'{model} parameter {name} = {value:g} must lie in [{low:g}, {high:g}]')


def check_inverse(model: str, alpha: float, lag: float, slope: float) -> None:
    """Refuse a model whose inverse would not be safe: a ValueError names what is out of bounds.

    The inverse divides by `alpha`, the ratio of actual to driving angle. `lag` in rad is half the
    width of a saturated loop along the actual angle, `slope` the greatest of the inverse.
    """
    check_range(model, 'alpha', alpha, SMALLEST_ALPHA, GREATEST_ALPHA)
    if not -1e-12 <= lag <= GREATEST_LAG * _ROUNDING:
        raise ValueError(
            f'{model} lag is {math.degrees(lag):.1f} deg: it must lie in '
            f'[0, {math.degrees(GREATEST_LAG):.0f}] deg'
        )
    if slope > GREATEST_INVERSE_SLOPE * _ROUNDING:
        raise ValueError(
            f'{model} inverse is too steep: {slope:.1f} exceeds {GREATEST_INVERSE_SLOPE:g}'
        )
