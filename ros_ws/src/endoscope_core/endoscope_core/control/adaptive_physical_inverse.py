"""Physical inverse and tracker together: the plant is learnt while it is inverted."""

from endoscope_core.control.physical_inverse import PhysicalInverse, PhysicalInverseSettings
from endoscope_core.control.physical_parameters import PhysicalParameters
from endoscope_core.control.plant_learning import PlantLearning, PlantLearningSettings


class AdaptivePhysicalInverse(PhysicalInverse):
    """A `PhysicalInverse` whose parameters follow the tracker.

    Feedback enters through the parameters alone: a command is always the inverse of one plant, so
    that delay and noise of the tracker cannot close a fast loop. Without a tracker it goes on with
    what was learnt.

    Parameters
    ----------
    parameters : PhysicalParameters
        To begin with.
    settings : PhysicalInverseSettings, optional
    learning : PlantLearningSettings, optional
    """

    def __init__(
        self,
        parameters: PhysicalParameters,
        settings: PhysicalInverseSettings | None = None,
        learning: PlantLearningSettings | None = None,
    ) -> None:
        super().__init__(parameters, settings)
        self._learning_settings = learning
        self._learning = PlantLearning(parameters, self.model, learning)

    def begin(self, direction: float, desired: float, velocity: float, command: float) -> float:
        """Start anew with what was learnt; return the command wanted now (rad)."""
        wanted = super().begin(direction, desired, velocity, command)
        self._learning = PlantLearning(self.parameters, self.model, self._learning_settings)
        return wanted

    def sent(self, command: float, dt: float) -> None:
        """What went out in the end, in force for `dt` s."""
        super().sent(command, dt)
        self._learning.sent(command, dt)

    def measured(self, age: float, angle: float) -> None:
        """Take a bending angle (rad) that held `age` s ago."""
        self.parameters = self._learning.measured(age, angle)
