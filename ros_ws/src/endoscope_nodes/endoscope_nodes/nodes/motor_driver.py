"""Drives the motor shafts: the simulated slave or a bus of servos, the same node for both."""

from collections import deque
from dataclasses import replace
from importlib.metadata import version

from std_msgs.msg import String

from endoscope_core.physics.plant_file import plant_as_text
from endoscope_core.rig import Kind, RigKind, digest, rig_as_text
from endoscope_core.safety import CommandLimits, MotionLimits, OperatingState, Refusal, ShaftMotion
from endoscope_devices.device import DeviceError, MotorDevice
from endoscope_devices.dynamixel.bring_up import BusSettings, ServoMount
from endoscope_devices.dynamixel.control_table import BAUD_CODES
from endoscope_devices.dynamixel.dynamixel_motors import DynamixelMotors
from endoscope_devices.simulated_slave import SimulatedSlave
from endoscope_nodes import names
from endoscope_nodes.runtime.diagnostics import ERROR, OK, WARN, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import DynamixelParameters, MotorDriverParameters
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import COMMAND, LOCK_STEP, RESULT, SENSOR_OFFERED
from endoscope_nodes.runtime.streams import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.runtime.ticker import TICK_NS, TICK_S
from endoscope_nodes.safety.sessions import SessionWatch
from endoscope_nodes.safety.streams import CommandReport

_REPEATED_NS = 50_000_000


class _Setpoint:
    """Publishes the goal of the shafts when it changes, and again after a while."""

    def __init__(self, node: EndoscopeNode) -> None:
        self._publisher = JointPublisher(
            node, names.MOTOR_SETPOINT, names.MOTORS, ('position',), SENSOR_OFFERED
        )
        self._sent: tuple[float, ...] = ()
        self._sent_ns = 0

    def publish(self, since_ns: int, goal: tuple[float, ...]) -> None:
        if goal and (goal != self._sent or since_ns - self._sent_ns >= _REPEATED_NS):
            self._sent, self._sent_ns = goal, since_ns
            self._publisher.publish(since_ns, *goal)


class _KindOfRig:
    """Publishes what kind of rig it is, and again where other servos were plugged in."""

    def __init__(self, node: EndoscopeNode, device: MotorDevice, context: NodeContext) -> None:
        self._device = device
        self._publisher = node.create_publisher(String, names.RIG_KIND, RESULT)
        program = f'endoscope {version("endoscope_nodes")}'
        self._rig = RigKind(device.kind, program, digest(rig_as_text(node.rig)))
        if self._rig.kind is Kind.SIMULATED:
            plant = digest(plant_as_text(context.plant))
            self._rig = replace(self._rig, plant=context.plant_name, plant_sha256=plant)
        self._publish()

    def follow(self) -> None:
        if self._device.kind is not self._rig.kind:
            self._rig = replace(self._rig, kind=self._device.kind)
            self._publish()

    def _publish(self) -> None:
        self._publisher.publish(String(data=self._rig.as_text()))


class MotorDriverNode(EndoscopeNode):
    """Obeys ``motor/servo_jp`` as far as it is safe, and publishes what the shafts do.

    A command of the open motion session, from one sender, passes gate and motion shaper; every tick
    the goal goes to the device and its reading is published. Without fresh commands the shafts go
    to the position measured at that moment and hold it; only ``DISABLED`` lets them go. The
    simulated slave also publishes what the simulated load cells and tracker read.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('motor_driver', context)
        device = self.parameters(MotorDriverParameters).device or self.rig.devices.motors
        self._device_name = device
        bus = self.parameters(DynamixelParameters)
        facts, timeout_ns = self.rig.motors, self.rig.timeouts.command_ns
        # The allowance of the gate holds for the time of receipt, which jitters, and the shaper
        # bounds what it lets pass.
        commands = CommandLimits(facts.reach, 1.25 * facts.speed, facts.entry_step, timeout_ns)
        limits = (facts.reach, facts.speed, facts.acceleration, facts.step)
        self.motion = ShaftMotion(commands, MotionLimits.either_way(len(names.MOTORS), *limits))
        self._device: MotorDevice = (
            SimulatedSlave(context.plant, names.MOTORS, context.seed_of(0))
            if device == 'simulated'
            else self._dynamixel(bus)
        )
        try:
            self._device.open()
        except DeviceError as error:
            raise ParameterError(f'motor_driver: {error}') from error
        self._trouble = ''
        self._arrived: list[tuple[JointSample, int, str]] = []
        self.latency_ns: deque[int] = deque(maxlen=1000)
        self._measured = JointPublisher(
            self,
            names.MOTOR_MEASURED,
            names.MOTORS,
            ('position', 'velocity', 'effort'),
            SENSOR_OFFERED,
        )
        self._setpoint = _Setpoint(self)
        kind = _KindOfRig(self, self._device, context)
        self._torque = False
        if self._slave is not None:
            self._sensors = (
                JointPublisher(self, names.SIMULATED_WIRES, names.WIRES, ('effort',), LOCK_STEP),
                JointPublisher(
                    self, names.SIMULATED_BENDING, names.JOINTS, ('position',), LOCK_STEP
                ),
            )
        self._state = ''
        self._session = SessionWatch(
            self, lambda: self._switch_torque(True), self._let_go, self.motion.session
        )
        self.create_subscription(String, names.OPERATING_STATE, self._on_state, RESULT)
        received = JointSubscription(
            self,
            names.MOTOR_COMMAND,
            names.MOTORS,
            self._on_command,
            COMMAND,
            exact=True,
            on_malformed=lambda reason: self.motion.gate.refuse(Refusal.MALFORMED, reason),
        )
        self._senders = self._session.senders_of(received.subscription)
        self._session.obeys(names.MOTOR_COMMAND, self.motion.gate)
        self.diagnostics.add(
            'commands', CommandReport(self.motion.gate, self.ticker, self._session.leave)
        )
        self.diagnostics.add('device', self._report_device, device)
        self.ticker.add(self._on_tick)
        self.ticker.every(1.0, kind.follow)

    @property
    def announcement(self) -> str:
        """Name the device."""
        return f'motors {self._device_name}'

    @property
    def _slave(self) -> SimulatedSlave | None:
        return self._device if isinstance(self._device, SimulatedSlave) else None

    def _dynamixel(self, parameters: DynamixelParameters) -> MotorDevice:
        self.require_real_time(self._device_name)
        motors = build_motors(parameters, self.rig.timeouts.command)
        self.serve(names.MOTOR_REBOOT, lambda: self._reboot(motors))
        return motors

    def _reboot(self, motors: DynamixelMotors) -> tuple[bool, str]:
        if self._session.name:
            return False, 'not while the slave is enabled'
        motors.reboot()
        return True, 'the servos restart without torque and are set up again'

    def _on_state(self, message: String) -> None:
        self._state = message.data
        self._let_go()

    def _let_go(self) -> None:
        # Switching torque off needs no more than somebody's word, switching it on needs a session.
        if self._state == OperatingState.DISABLED and not self._session.name:
            self._switch_torque(False)

    def _switch_torque(self, on: bool) -> None:
        self._torque = on
        self._device.set_torque(on)

    def _on_command(self, sample: JointSample) -> None:
        self._arrived.append((sample, self.ticker.monotonic_ns(), self._senders.rivals()))

    def _on_tick(self, stamp_ns: int, periods: int) -> None:
        self._notice_trouble()
        self._judge_what_arrived()
        goal = self.motion.turn(self.ticker.monotonic_ns(), periods * TICK_S)
        self._session.publish()
        reading = self._device.exchange(goal or (0.0,) * len(names.MOTORS), periods)
        slave = self._slave
        if slave is not None:
            # The plant has just gone on under it for these periods.
            self._setpoint.publish(stamp_ns - periods * TICK_NS, slave.goal)
        elif self._torque:
            self._setpoint.publish(self.ticker.now_ns(), goal)
        if reading is None:
            return
        self.motion.measure(reading.position)
        if slave is None:
            stamp_ns = self.ticker.now_ns() - round(reading.age * 1e9)
        self._measured.publish(stamp_ns, *reading.position, *reading.velocity, *reading.effort)
        if slave is not None:
            wires, bending = self._sensors
            wires.publish(stamp_ns, *slave.tension)
            bending.publish(stamp_ns, *slave.bending)

    def _judge_what_arrived(self) -> None:
        """Take commands by the session of the turn that gives the goal."""
        # Within a tick the middleware may bring the last one before or after the end of its
        # session.
        for sample, received_ns, rivals in self._arrived:
            refusal = self.motion.command(
                sample.session,
                sample.stamp_ns,
                sample.position,
                sample.velocity,
                received_ns,
                rivals,
            )
            if refusal is None and not self.ticker.simulated:
                self.latency_ns.append(received_ns - self.ticker.monotonic_of(sample.stamp_ns))
        self._arrived.clear()

    def _notice_trouble(self) -> None:
        """Tell a trouble of the device in the tick in which it comes or goes."""
        trouble = self._device.trouble()
        if bool(trouble) != bool(self._trouble):
            self._trouble = trouble
            if trouble:
                self.get_logger().error(trouble)
                self.motion.hold()
            self.diagnostics.publish()

    def _report_device(self) -> Report:
        trouble = self._device.trouble()
        values = self._device.health()
        values |= {
            'ticks': self.ticker.ticks,
            'missed ticks': self.ticker.missed,
            'published': self._measured.count,
            'times held': self.motion.holds,
            'holding': self.motion.holding,
            'commands bounded': self.motion.shaper.bounded,
            'rig': self._device.kind,
        }
        if self.latency_ns:
            ordered = sorted(self.latency_ns)
            values['command latency p50 [ms]'] = ordered[len(ordered) // 2] * 1e-6
            values['command latency p99 [ms]'] = ordered[len(ordered) * 99 // 100] * 1e-6
        if trouble:
            return ERROR, trouble, values
        if not self.motion.goal:
            return WARN, 'no reading yet', values
        return OK, 'holding' if self.motion.holding else 'following commands', values

    def close(self) -> None:
        """Let go of the device."""
        self._device.close()


def build_motors(p: DynamixelParameters, goal_timeout: float) -> DynamixelMotors:
    """Make the bus; a goal not renewed for `goal_timeout` s is given up."""
    for name in ('servo_ids', 'servo_directions', 'servo_zeros'):
        if len(getattr(p, name)) != len(names.MOTORS):
            raise ParameterError(
                f"motor_driver: parameter '{name}' has {len(getattr(p, name))} values; give one "
                f'for each of {", ".join(names.MOTORS)}'
            )
    if len(set(p.servo_ids)) != len(names.MOTORS):
        raise ParameterError("motor_driver: parameter 'servo_ids' names a servo twice")
    if 0 in p.servo_directions:
        raise ParameterError("motor_driver: parameter 'servo_directions' is 0; give 1 or -1")
    if p.baud not in BAUD_CODES.values():
        known = ', '.join(str(baud) for baud in BAUD_CODES.values())
        raise ParameterError(f"motor_driver: parameter 'baud' is {p.baud}; give one of {known}")
    mounts = [
        ServoMount(*mount)
        for mount in zip(names.MOTORS, p.servo_ids, p.servo_directions, p.servo_zeros, strict=True)
    ]
    try:
        settings = BusSettings(
            p.port,
            p.baud,
            p.current_limit,
            p.bus_watchdog,
            rate=p.bus_rate,
            goal_timeout=goal_timeout,
            fault_after=p.fault_after,
        )
    except DeviceError as error:
        raise ParameterError(f'motor_driver: {error}') from error
    return DynamixelMotors(settings, mounts)
