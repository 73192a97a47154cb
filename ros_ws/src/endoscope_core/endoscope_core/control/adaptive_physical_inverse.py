"""Physical inverse and tracker together: the plant is learnt while it is inverted."""

from endoscope_core.control.motor_limits import MotorLimits
from endoscope_core.control.physical_inverse import PhysicalInverse
from endoscope_core.control.physical_parameters import PhysicalParameters
from endoscope_core.control.plant_learning import PlantLearning, PlantLearningSettings
from endoscope_core.control.smoothing import COUNT


class AdaptivePhysicalInverse(PhysicalInverse):
    """A `PhysicalInverse` whose parameters follow the tracker.

    Feedback enters through the parameters alone: a command is always the inverse of one plant, so
    that delay and noise of the tracker cannot close a fast loop. Without a tracker it goes on with
    what was learnt.

    Parameters
    ----------
    parameters : PhysicalParameters
        To begin with.
    limits : MotorLimits, optional
    dead_band : float
    learning : PlantLearningSettings, optional
    """

    def __init__(
        self,
        parameters: PhysicalParameters,
        limits: MotorLimits | None = None,
        dead_band: float = 2.0 * COUNT,
        learning: PlantLearningSettings | None = None,
    ) -> None:
        super().__init__(parameters, limits, dead_band)
        self._learning_settings = learning
        self._learning = PlantLearning(parameters, self.limits.gear, settings=learning)

    def begin(self, direction: float, desired: float, velocity: float) -> float:
        """Start anew with what was learnt; return the command wanted now (rad)."""
        self.parameters = self._learning.parameters
        wanted = super().begin(direction, desired, velocity)
        self._learning = PlantLearning(
            self.parameters, self.limits.gear, self.shafts, self._learning_settings
        )
        return wanted

    def sent(self, command: float, dt: float) -> None:
        """What went out in the end, in force for `dt` s."""
        self._learning.sent(command, dt)

    def measured(self, age: float, angle: float) -> None:
        """Take a bending angle (rad) that held `age` s ago.

        What was learnt enters where the model's joint is where it shall be. In the middle of a dead
        zone the command goes on with what was known before: a wider or narrower one has no place
        for it.
        """
        self._learning.measured(age, angle)
        if self.arrived and self._learning.modelled is not self.parameters:
            self.take(self._learning.modelled)
