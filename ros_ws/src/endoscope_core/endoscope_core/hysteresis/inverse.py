"""Inverses of the hysteresis models as steps over the desired angle."""

from endoscope_core.hysteresis.bouc_wen import BoucWenParameters
from endoscope_core.hysteresis.dahl import DahlParameters
from endoscope_core.hysteresis.memory_model import MemoryModel

HysteresisParameters = BoucWenParameters | DahlParameters

MODELS: dict[str, type[HysteresisParameters]] = {
    'bouc_wen': BoucWenParameters,
    'dahl': DahlParameters,
}
"""Every model by the name that commands and node parameters use."""


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
        """Which way the desired motion has taken, in [-1, 1]."""
        return self._memory

    def command(self) -> float:
        """``(theta_d - offset + lag y) / alpha`` in rad, equation 5 of the first paper."""
        model = self._model
        return (self._angle - model.offset + model.lag * self._memory) / model.alpha

    def move_to(self, angle: float) -> None:
        """Follow the desired angle to `angle` rad, monotonically."""
        self._memory = self._model.memory_step(self._memory, angle - self._angle)
        self._angle = angle
