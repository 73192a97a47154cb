"""Drives the motor shafts, and is the simulated slave where there is no hardware."""

from collections import deque
from dataclasses import dataclass

from std_srvs.srv import Trigger

from endoscope_core.safety import CommandGate, CommandLimits, OperatingState, Refusal
from endoscope_devices.dynamixel.dynamixel_motors import DynamixelMotors
from endoscope_devices.motor_device import DeviceError, MotorDevice, MotorReading
from endoscope_devices.simulated_slave import SimulatedSlave
from endoscope_nodes.command_report import CommandReport
from endoscope_nodes.diagnostics import ERROR, OK, WARN, Report
from endoscope_nodes.dynamixel_parameters import DynamixelParameters, build_motors
from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.joint_stream import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.names import (
    JOINTS,
    MOTOR_COMMAND,
    MOTOR_MEASURED,
    MOTOR_REBOOT,
    MOTORS,
    OPERATING_STATE,
    SIMULATED_BENDING,
    SIMULATED_WIRES,
    WIRES,
)
from endoscope_nodes.parameters import ParameterError, parameter
from endoscope_nodes.plant_parameter import load_plant_parameter
from endoscope_nodes.qos import COMMAND, LOCK_STEP, SENSOR_OFFERED
from endoscope_nodes.runtime import Runtime, run_nodes
from endoscope_nodes.state_watch import StateWatch


@dataclass(frozen=True)
class MotorDriverParameters:
    """Parameters of the motor driver."""

    device: str = parameter('simulated', 'what is driven', choices=('simulated', 'dynamixel'))
    plant_file: str = parameter(
        '', 'plant.yaml of the simulated slave; empty for the nominal plant'
    )
    seed: int = parameter(1, 'seed of the simulated sensor noise', low=0)
    shaft_limit: float = parameter(
        1.6, 'largest shaft angle obeyed, either way', unit='rad', low=0.0, high=20.0
    )
    max_speed: float = parameter(
        40.0, 'largest speed of the shaft between two commands', unit='rad/s', low=0.0
    )
    max_step: float = parameter(
        0.1, 'largest distance of the first command from the measured position', unit='rad', low=0.0
    )
    command_timeout: float = parameter(
        0.1,
        'a command older than this is not obeyed, and without a newer one the measured '
        'position is held',
        unit='s',
        low=0.001,
        high=1.0,
    )


class MotorDriverNode(EndoscopeNode):
    """Obeys ``motor/servo_jp`` as far as it is safe, and publishes what the shafts do.

    Every tick the newest obeyed command goes to the device and its reading is published.  Without
    fresh commands, and in any state but ``ENABLED``, the position measured at that moment is held;
    only ``DISABLED`` lets the shafts go.  After a trouble of the device nothing moves until the
    slave is enabled anew.  The simulated slave also publishes the noise-free tensions and angles
    that the simulated load cells and tracker read.
    """

    def __init__(self, runtime: Runtime) -> None:
        super().__init__('motor_driver', runtime)
        p = self._settings = self.parameters(MotorDriverParameters)
        bus = self.parameters(DynamixelParameters)
        self.gate = CommandGate(
            CommandLimits(
                (-p.shaft_limit,) * 2,
                (p.shaft_limit,) * 2,
                p.max_speed,
                p.max_step,
                round(p.command_timeout * 1e9),
            )
        )
        self._slave = self._simulated() if p.device == 'simulated' else None
        self._device: MotorDevice = self._slave or self._dynamixel(bus)
        try:
            self._device.open()
        except DeviceError as error:
            raise ParameterError(f'motor_driver: {error}') from error
        self._trouble = ''
        self._goal: tuple[float, ...] = (0.0,) * len(MOTORS)
        self._reading: MotorReading | None = None
        self._holding = True
        self._holds = 0
        self.latency_ns: deque[int] = deque(maxlen=1000)
        self._measured = JointPublisher(
            self, MOTOR_MEASURED, MOTORS, ('position', 'velocity', 'effort'), SENSOR_OFFERED
        )
        if self._slave is not None:
            self._wires = JointPublisher(self, SIMULATED_WIRES, WIRES, ('effort',), LOCK_STEP)
            self._bending = JointPublisher(
                self, SIMULATED_BENDING, JOINTS, ('position',), LOCK_STEP
            )
        self._state = StateWatch(self, self.ticker, self._on_state)
        JointSubscription(
            self,
            MOTOR_COMMAND,
            MOTORS,
            self._on_command,
            COMMAND,
            exact=True,
            on_malformed=self._on_malformed,
        )
        self.diagnostics.add('commands', CommandReport(self.gate))
        self.diagnostics.add('device', self._report_device, p.device)
        self.ticker.add(self._on_tick)

    def _simulated(self) -> SimulatedSlave:
        p = self._settings
        plant = load_plant_parameter('motor_driver', p.plant_file)
        return SimulatedSlave(plant, MOTORS, p.seed)

    def _dynamixel(self, parameters: DynamixelParameters) -> MotorDevice:
        if self.ticker.simulated:
            raise ParameterError(
                "motor_driver: parameter 'use_sim_time' is true; real servos live in real time"
            )
        motors = build_motors(parameters, MOTORS, self._settings.command_timeout)
        self.create_service(Trigger, MOTOR_REBOOT, lambda _, answer: self._reboot(motors, answer))
        return motors

    def _reboot(self, motors: DynamixelMotors, answer: Trigger.Response) -> Trigger.Response:
        answer.success = not self._state.enabled
        answer.message = 'not while the slave is enabled'
        if answer.success:
            motors.reboot()
            answer.message = 'the servos restart without torque and are set up anew'
        return answer

    def _on_state(self, state: OperatingState) -> None:
        self._hold()
        if self._reading is not None:
            self._goal = self._reading.position
        if state is OperatingState.ENABLED:
            self.gate.reset()
            self._device.set_torque(True)
        elif state is OperatingState.DISABLED:
            self._device.set_torque(False)

    def _hold(self) -> None:
        if not self._holding and self._reading is not None:
            self._goal = self._reading.position
            self._holds += 1
        self._holding = True

    def _on_malformed(self, reason: str) -> None:
        self.gate.refuse(Refusal.MALFORMED, reason)

    @property
    def _may_move(self) -> bool:
        return self._state.enabled and not self._state.interrupted

    def _on_command(self, sample: JointSample) -> None:
        if not self._may_move:
            self.gate.refuse(Refusal.NOT_ENABLED)
            return
        held = self._goal if self._reading is None else self._reading.position
        if (
            self.gate.check(
                sample.stamp_ns, sample.position, sample.velocity, self.ticker.monotonic_ns(), held
            )
            is None
        ):
            self._goal = sample.position
            self._holding = False
            if not self.ticker.simulated:
                self.latency_ns.append(self.ticker.now_ns() - sample.stamp_ns)

    def _on_tick(self, stamp_ns: int, periods: int) -> None:
        self._notice_trouble()
        if not self._holding and not (
            self.gate.is_fresh(self.ticker.monotonic_ns()) and self._may_move
        ):
            self._hold()
        reading = self._device.exchange(self._goal, periods)
        if reading is None:
            return
        self._reading = reading
        if self._slave is None:
            stamp_ns = self.ticker.now_ns() - round(reading.age * 1e9)
        self._measured.publish(stamp_ns, *reading.position, *reading.velocity, *reading.effort)
        if self._slave is not None:
            self._wires.publish(stamp_ns, *self._slave.tension)
            self._bending.publish(stamp_ns, *self._slave.bending)

    def _notice_trouble(self) -> None:
        """Tell a trouble of the device in the tick in which it comes or goes."""
        trouble = self._trouble_now()
        if bool(trouble) != bool(self._trouble):
            self._trouble = trouble
            if trouble:
                self.get_logger().error(trouble)
                self._hold()
            self.diagnostics.publish()

    def _trouble_now(self) -> str:
        if self._state.interrupted:
            return f'{OPERATING_STATE} had been silent: give enable anew'
        return self._device.trouble()

    def _report_device(self) -> Report:
        trouble = self._trouble_now()
        values = self._device.health()
        values |= {
            'ticks': self.ticker.ticks,
            'missed ticks': self.ticker.missed,
            'published': self._measured.count,
            'times held': self._holds,
            'holding': self._holding,
        }
        if self.latency_ns:
            ordered = sorted(self.latency_ns)
            values['command latency p50 [ms]'] = ordered[len(ordered) // 2] * 1e-6
            values['command latency p99 [ms]'] = ordered[len(ordered) * 99 // 100] * 1e-6
        if trouble:
            return ERROR, trouble, values
        if self._reading is None:
            return WARN, 'no reading yet', values
        return OK, 'holding' if self._holding else 'following commands', values

    def close(self) -> None:
        """Let go of the device."""
        self._device.close()


def main() -> int:
    """Run the motor driver in a process of its own."""
    return run_nodes([MotorDriverNode])
