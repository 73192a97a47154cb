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
