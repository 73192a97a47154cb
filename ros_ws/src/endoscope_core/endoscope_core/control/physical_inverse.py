"""Commands that move a joint as desired, by inverting the plant that a calibration identified."""

from __future__ import annotations

import math

from endoscope_core.control.internal_model import InternalModel, PhysicalParameters, TurningPoints
from endoscope_core.control.limits import COUNT, MotorLimits
from endoscope_core.control.plant_learning import PlantLearning

SWING = 1.0
"""Rad from which a joint is taken to have come whose motion is known by its direction alone."""


class PhysicalInverse:
    """Turns the shaft of an internal model so that its joint moves as desired, and says how.

    The model follows what is wanted, not what went out: an offset that someone adds to the command
    must not be taken back as an error of the joint. `dead_band` is in rad.
    """

    def __init__(
        self,
        parameters: PhysicalParameters,
        limits: MotorLimits,
        dead_band: float = 2.0 * COUNT,
    ) -> None:
        self.parameters = parameters
        self.limits = limits
        self._dead_band = dead_band
        self.servo_lag = parameters.servo_lag
        self.other = 0.0  # where the other joint is to be, rad: the two may be coupled
        self.model = InternalModel(parameters.joint, self.limits, parameters.added)
        self._turns = TurningPoints([0.0])
        self.direction = 0.0  # in which the joint was bent last, -1 or 1; 0 before
        # The model's joint is where it shall be: no dead zone to cross, no limit met.
        self.arrived = True
        # Turning points of the shaft until parameters were last taken over, rad.
        self.shafts: tuple[float, ...] = (0.0,)

    @property
    def command(self) -> float:
        """What is wanted now, rad."""
        return self.model.shaft / self.limits.gear

    def begin(self, direction: float, desired: float, velocity: float) -> float:
        """Start at a desired angle and velocity (rad, rad/s); return the command wanted (rad).

        The joint is taken to have come there from the other side where `direction` says a way, in
        [-1, 1], and from rest at zero otherwise.
        """
        target = desired + self.servo_lag * velocity
        self.direction = 0.0 if abs(direction) < 0.5 else math.copysign(1.0, direction)
        before = [target - self.direction * SWING] if self.direction else []
        self._turns = TurningPoints([0.0, *before, target])
        self.take(self.parameters)
        return self.command

    def wanted(self, desired: float, velocity: float, dt: float) -> float:
        """Command (rad) for a desired angle (rad) and velocity (rad/s) `dt` s after the last."""
        target = desired + self.servo_lag * velocity
        self.model.other = self.other
        missing = target - self.model.angle
        # At a reversal the joint stands still until the front of the turning motor has come through
        # the sheath; that dead zone is crossed as fast as the motor can. So that noise at rest does
        # not cross it to and fro, the model turns back only once `dead_band` is passed.
        if missing * self.direction <= 0.0 and abs(missing) <= self._dead_band:
            self.model.turn(self.model.shaft, dt)
        else:
            self.direction = math.copysign(1.0, missing)
            self.arrived = self.model.seek(target, dt)
            self._turns.follow(self.model.angle)
        return self.command

    def sent(self, command: float, dt: float) -> None:
        """Nothing depends on it."""

    def take(self, parameters: PhysicalParameters) -> None:
        """Go on as another plant that has come the same way."""
        self.parameters = parameters
        self.model = InternalModel(parameters.joint, self.limits, parameters.added)
        self.model.other = self.other
        self.shafts = (0.0, *self.model.go_through(self._turns.values[1:]))
        self.arrived = True


class AdaptivePhysicalInverse(PhysicalInverse):
    """A `PhysicalInverse` whose parameters follow the tracker; angles in rad.

    Feedback enters through the parameters alone: a command is always the inverse of one plant, so
    that delay and noise of the tracker cannot close a fast loop. Without a tracker it goes on with
    what was learnt.
    """

    def __init__(
        self,
        parameters: PhysicalParameters,
        limits: MotorLimits,
        dead_band: float = 2.0 * COUNT,
    ) -> None:
        super().__init__(parameters, limits, dead_band)
        self._learning = PlantLearning(parameters, self.limits.gear)

    def begin(self, direction: float, desired: float, velocity: float) -> float:
        """Start again with what was learnt; return the command wanted now (rad)."""
        self.parameters = self._learning.parameters
        wanted = super().begin(direction, desired, velocity)
        self._learning = PlantLearning(self.parameters, self.limits.gear, self.shafts)
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
