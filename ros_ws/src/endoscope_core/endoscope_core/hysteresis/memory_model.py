"""Hysteresis models of one state, bounds of their parameters, and their direct inverse."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

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


@dataclass(frozen=True)
class NamedNumbers:
    """Base of parameter sets whose fields are all numbers."""

    MODEL: ClassVar[str]
    """The model's name in messages."""

    def to_dict(self) -> dict[str, float]:
        """The parameters by name."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Parameters from a mapping of exactly their names.

        Raises ValueError: if a name is missing or unknown, or the parameters are unsafe.
        """
        wanted = {field.name for field in fields(cls)}
        if set(values) != wanted:
            odd = ', '.join(sorted(set(values) ^ wanted))
            raise ValueError(
                f'{cls.MODEL} parameters must be exactly {", ".join(sorted(wanted))}; '
                f'wrong or missing: {odd}'
            )
        return cls(**{name: float(value) for name, value in values.items()})


class MemoryModel(Protocol):
    """``theta_a = alpha theta + offset - lag y``: Bouc-Wen and Dahl are of this form.

    The direct inverse (equation 5 of the first paper, section 2.3 of the second) drives `y` with
    the desired angle and puts out ``(theta_d - offset + lag y) / alpha``.
    """

    @property
    def alpha(self) -> float:
        """Ratio of actual to driving angle."""
        ...

    @property
    def offset(self) -> float:
        """Actual angle where the driving angle and the memory are zero, rad."""
        ...

    @property
    def inverse_slope(self) -> float:
        """Bound of the slope of the direct inverse."""
        ...

    @property
    def lag(self) -> float:
        """Half-width of a saturated loop along the actual angle, rad."""
        ...

    def memory_step(self, y: float, delta: float) -> float:
        """Memory after a move by `delta` rad."""
        ...

    def memory_path(self, driver: NDArray[np.float64], y0: float) -> NDArray[np.float64]:
        """Memory (N,) along a driving angle (N,), `y0` at the first sample."""
        ...

    def to_dict(self) -> dict[str, float]:
        """Parameters by name."""
        ...


def check_inverse(name: str, model: MemoryModel) -> None:
    """Refuse a model whose inverse would not be safe: a ValueError says what is out of bounds."""
    check_range(name, 'alpha', model.alpha, SMALLEST_ALPHA, GREATEST_ALPHA)
    if not -1e-12 <= model.lag <= GREATEST_LAG * _ROUNDING:
        raise ValueError(
            f'{name} lag is {math.degrees(model.lag):.1f} deg: it must lie '
            f'from 0 to {math.degrees(GREATEST_LAG):.0f} deg'
        )
    if model.inverse_slope > GREATEST_INVERSE_SLOPE * _ROUNDING:
        raise ValueError(
            f'{name} inverse is too steep: {model.inverse_slope:.1f} exceeds '
            f'{GREATEST_INVERSE_SLOPE:g}'
        )


def forward(model: MemoryModel, theta: ArrayLike, y0: float = 0.0) -> NDArray[np.float64]:
    """Actual angle (N,) for a driving angle (N,), both in rad; the memory begins at `y0`."""
    driver = _series(theta)
    memory = model.memory_path(driver, y0)
    result: NDArray[np.float64] = model.alpha * driver + model.offset - model.lag * memory
    return result


def direct_inverse(model: MemoryModel, theta_d: ArrayLike) -> NDArray[np.float64]:
    """Command (N,) for a desired angle (N,), both in rad; the memory begins at 0."""
    driver = _series(theta_d)
    memory = model.memory_path(driver, 0.0)
    result: NDArray[np.float64] = (driver - model.offset + model.lag * memory) / model.alpha
    return result


def _series(values: ArrayLike) -> NDArray[np.float64]:
    series = np.ascontiguousarray(values, dtype=float)
    if series.ndim != 1 or series.size == 0 or not np.all(np.isfinite(series)):
        raise ValueError(
            'the driving angle must be a non-empty series of finite numbers; '
            f'its shape is {series.shape}'
        )
    return series


class DirectInverse:
    """Inverse of a model with one memory, which the desired angle drives.

    It begins with a memory `direction` in [-1, 1] and a desired `angle` in rad.
    """

    def __init__(self, model: MemoryModel, direction: float, angle: float) -> None:
        self._model = model
        self.direction = min(1.0, max(-1.0, direction))  # that the motion has taken, in [-1, 1]
        self._angle = angle

    def command(self) -> float:
        """``(theta_d - offset + lag y) / alpha`` in rad, equation 5 of the first paper."""
        model = self._model
        return (self._angle - model.offset + model.lag * self.direction) / model.alpha

    def move_to(self, angle: float) -> None:
        """Follow the desired angle to `angle` rad, monotonically."""
        self.direction = self._model.memory_step(self.direction, angle - self._angle)
        self._angle = angle
