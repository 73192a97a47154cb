"""The simulated slave behind the interface of a servo bus."""

from collections.abc import Sequence

from endoscope_core.physics import PlantDescription, PlantSample, PlantSimulator, SensorModel
from endoscope_core.rig import Kind
from endoscope_devices.device import MotorReading

Numbers = tuple[float, ...]


class SimulatedSlave:
    """Servos, wires and J joints of a plant, advanced by the motor driver's beat."""

    kind = Kind.SIMULATED

    def __init__(self, plant: PlantDescription, names: Sequence[str], seed: int) -> None:
        if len(names) != len(plant.joint_names()):
            raise ValueError(f'{len(names)} motors for {len(plant.joint_names())} joints')
        self.names = tuple(names)  # of motors, in the order of the joints
        self._plant = plant
        self._simulator = PlantSimulator(plant)
        self._sensors = SensorModel(plant.sensors, seed)
        self._torque = False
        self.goal: Numbers = (0.0,) * len(self.names)  # where the servos go or stand, rad, (J,)
        self._started = False
        # Noise-free wire tensions in N after the last exchange, (2 J,): positive and negative wire
        # of each joint in turn.
        self.tension: Numbers = ()
        self.bending: Numbers = ()  # noise-free angles in rad as the tracker would read them, (J,)

    def open(self) -> None:
        """Nothing to connect; the plant is compiled here rather than in the first tick."""
        PlantSimulator(self._plant).advance(self.goal)
        self._take(self._simulator.sample)

    def set_torque(self, on: bool) -> None:
        """A servo without torque is held by its gear: the goal stays where it was."""
        self._torque = on

    def exchange(self, goal: Sequence[float], periods: int) -> MotorReading | None:
        """Advance under the goal that is in force since the last call; the first only reads."""
        if not self._started:
            self._started = True
            return self._take(self._simulator.sample)
        if self._torque:
            self.goal = tuple(goal)
        return self._take(self._simulator.advance(self.goal, periods))

    def _take(self, sample: PlantSample) -> MotorReading:
        self.tension = tuple(sample.tension.ravel().tolist())
        self.bending = tuple(sample.bending.tolist())
        sensors = self._sensors
        return MotorReading(
            tuple(sensors.shaft_position(sample.shaft_position).tolist()),
            tuple(sensors.shaft_velocity(sample.shaft_velocity).tolist()),
            tuple(sensors.shaft_effort(sample.shaft_effort).tolist()),
        )

    def trouble(self) -> str:
        """A simulation has nothing to complain about."""
        return ''

    def health(self) -> dict[str, object]:
        """Nothing to report."""
        return {}

    def close(self) -> None:
        """Nothing to let go of."""
