"""Inverses of all hysteresis models as steps over the desired angle."""

from __future__ import annotations

from typing import Protocol

from endoscope_core.hysteresis.bouc_wen import AsymmetricBoucWenParameters, BoucWenParameters
from endoscope_core.hysteresis.dahl import DahlParameters, PlayParameters
from endoscope_core.hysteresis.memory_model import MemoryModel
from endoscope_core.hysteresis.prandtl_ishlinskii import (
    PrandtlIshlinskiiParameters,
    advance_plays,
    saturated_plays,
)

HysteresisParameters = (
    BoucWenParameters
    | AsymmetricBoucWenParameters
    | DahlParameters
    | PlayParameters
    | PrandtlIshlinskiiParameters
)

MODELS: dict[str, type[HysteresisParameters]] = {
    'bouc_wen': BoucWenParameters,
    'asymmetric_bouc_wen': AsymmetricBoucWenParameters,
    'dahl': DahlParameters,
    'play': PlayParameters,
    'prandtl_ishlinskii': PrandtlIshlinskiiParameters,
}
"""Every model by the name that commands and node parameters use."""


class Inverse(Protocol):
    """The inverse of one model, with its memory."""

    @property
    def direction(self) -> float:
        """Which way the desired motion has taken, in [-1, 1]."""
        ...

    def command(self) -> float:
        """Command for the angle last moved to, rad."""
        ...

    def move_to(self, angle: float) -> None:
        """Follow the desired angle to `angle` rad, monotonically."""
        ...


class DirectInverse:
    """Inverse of a model with one memory, which the desired angle drives.

    It begins with a memory `direction` in [-1, 1] and a desired `angle` in rad.
    """

    def __init__(self, model: MemoryModel, direction: float, angle: float) -> None:
        self._model = model
        self._memory = min(1.0, max(-1.0, direction))
        self._angle = angle

    @property
    def direction(self) -> float:
        return self._memory

    def command(self) -> float:
        """``(theta_d - offset + lag(theta_d) y) / alpha``, equation 5 of the first paper."""
        model = self._model
        lag = model.lag_at(self._angle) * self._memory
        return (self._angle - model.offset + lag) / model.alpha

    def move_to(self, angle: float) -> None:
        self._memory = self._model.memory_step(self._memory, angle - self._angle, angle)
        self._angle = angle


class PlayStackInverse:
    """Exact inverse of the Prandtl-Ishlinskii model.

    At a desired `angle` in rad, its plays begin as far on their sides as `direction` in [-1, 1].
    """

    def __init__(
        self, parameters: PrandtlIshlinskiiParameters, direction: float, angle: float
    ) -> None:
        self._thresholds, self._weights = parameters.inverse_stack
        self._offset = parameters.offset
        self._angle = angle - self._offset
        self._plays = saturated_plays(self._thresholds, self._angle, direction)

    @property
    def direction(self) -> float:
        """How far the widest play is on its side."""
        width = float(self._thresholds[-1])
        return float(self._angle - self._plays[-1]) / width if width > 0.0 else 0.0

    def command(self) -> float:
        """Weighted sum of the inverse's plays, rad."""
        return float(self._weights @ self._plays)

    def move_to(self, angle: float) -> None:
        self._angle = angle - self._offset
        self._plays = advance_plays(self._thresholds, self._plays, self._angle)


def inverse_of(parameters: HysteresisParameters, direction: float, angle: float) -> Inverse:
    """The inverse of a model, beginning at a desired angle (rad) reached in `direction`."""
    if isinstance(parameters, PrandtlIshlinskiiParameters):
        return PlayStackInverse(parameters, direction, angle)
    return DirectInverse(parameters, direction, angle)
