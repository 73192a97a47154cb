"""Turns desired bending into motor commands that make up for the hysteresis."""

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray

from endoscope_core.safety import BumplessOutput, CommandGate, CommandLimits, Refusal
from endoscope_nodes.command_report import CommandReport
from endoscope_nodes.diagnostics import OK, Report
from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.joint_stream import (
    JointPublisher,
    JointSample,
    JointSubscription,
    LatestJointState,
)
from endoscope_nodes.names import (
    CALIBRATION_COMMAND,
    COMPENSATOR_STATE,
    CORRECTION,
    JOINTS,
    MOTOR_COMMAND,
    MOTOR_MEASURED,
    MOTORS,
    SLAVE_COMMAND,
)
from endoscope_nodes.parameters import parameter
from endoscope_nodes.qos import COMMAND, RESULT, SENSOR_ASKED
from endoscope_nodes.runtime import Runtime, run_nodes
from endoscope_nodes.state_watch import StateWatch

CONSOLE = 'console'
CALIBRATION = 'calibration'
NOBODY = 'nobody'


@dataclass(frozen=True)
class CompensatorParameters:
    """Parameters of the compensator."""

    mode: str = parameter(
        'bouc_wen', 'feed-forward model in force', choices=('none', 'bouc_wen'), dynamic=True)
    gear: float = parameter(
        0.5, 'shaft angle for one radian at the joint', low=0.01, high=100.0)
    joint_limit: float = parameter(
        1.75, 'largest desired bending obeyed, either way', unit='rad', low=0.1, high=3.1)
    drive_limit: float = parameter(
        3.0, 'largest joint-equivalent motor angle put out, either way', unit='rad', low=0.1,
        high=10.0)
    max_speed: float = parameter(
        30.0, 'largest speed between two commands', unit='rad/s', low=0.0)
    max_step: float = parameter(
        1.0, 'largest distance of the first command from the last one obeyed', unit='rad', low=0.0)
    command_timeout: float = parameter(
        0.1, 'a command older than this is not obeyed', unit='s', low=0.001, high=1.0)
    blend_time: float = parameter(
        0.5, 'shortest time in which a change of source, model or feedback is faded in', unit='s',
        low=0.01, high=10.0)
    blend_speed: float = parameter(
        1.0, 'largest speed that such a fade adds', unit='rad/s', low=0.01, high=10.0)


class CompensatorNode(EndoscopeNode):
    """The only publisher of ``motor/servo_jp``.

    Calibration goes before the console while its commands are fresh, and passes uncompensated.
    Every change of source, model, parameters or feedback is faded in from what was put out before,
    or from where the motors are after a pause.
    """

    def __init__(self, runtime: Runtime) -> None:
        super().__init__('compensator', runtime)
        p = self.parameters(CompensatorParameters, self._on_parameters)
        self._settings = p
        limits = CommandLimits((-p.joint_limit,) * 2, (p.joint_limit,) * 2, p.max_speed, p.max_step,
                               round(p.command_timeout * 1e9))
        self.gate = CommandGate(limits)
        self.calibration_gate = CommandGate(limits)
        self._blend = BumplessOutput(len(JOINTS), p.blend_time, p.blend_speed)
        self._source = NOBODY
        self._last_stamp_ns = 0
        self._corrections: tuple[JointSample | None, JointSample | None] = (None, None)
        self._corrected = False
        self._saturated = 0
        self._motors = JointPublisher(self, MOTOR_COMMAND, MOTORS, ('position',), COMMAND)
        self._states = self.create_publisher(DiagnosticArray, COMPENSATOR_STATE, RESULT)
        self._state = StateWatch(self, self.ticker, lambda _: self._start_anew())
        self._shafts = LatestJointState(self, MOTOR_MEASURED, MOTORS, SENSOR_ASKED)
        JointSubscription(self, CALIBRATION_COMMAND, JOINTS, self._on_calibration, COMMAND,
                          exact=True, on_malformed=self._on_malformed)
        JointSubscription(self, SLAVE_COMMAND, JOINTS, self._on_console, COMMAND, exact=True,
                          on_malformed=self._on_malformed)
        JointSubscription(self, CORRECTION, JOINTS, self._on_correction, COMMAND)
        self.diagnostics.add('commands', CommandReport(self.gate))
        self.diagnostics.add('output', self._report)

    def _on_parameters(self, parameters: CompensatorParameters) -> None:
        self._settings = parameters
        self._blend.change()

    def _start_anew(self) -> None:
        self.gate.reset()
        self.calibration_gate.reset()
        self._source = NOBODY

    def _on_malformed(self, reason: str) -> None:
        self.gate.refuse(Refusal.MALFORMED, reason)

    def _on_correction(self, sample: JointSample) -> None:
        self._corrections = (self._corrections[1], sample)

    def _on_console(self, sample: JointSample) -> None:
        now = self.ticker.monotonic_ns()
        if not self._state.enabled:
            self.gate.refuse(Refusal.NOT_ENABLED)
            return
        if self.calibration_gate.is_fresh(now):
            return
        if self.gate.check(sample.stamp_ns, sample.position, sample.velocity, now) is None:
            self._drive(CONSOLE, sample.stamp_ns, sample.position, now)

    def _on_calibration(self, sample: JointSample) -> None:
        now = self.ticker.monotonic_ns()
        if not self._state.enabled:
            self.calibration_gate.refuse(Refusal.NOT_ENABLED)
            return
        if self.calibration_gate.check(
                sample.stamp_ns, sample.position, sample.velocity, now) is None:
            self._drive(CALIBRATION, sample.stamp_ns, sample.position, now)

    def _drive(self, source: str, stamp_ns: int, wanted: tuple[float, ...], now_ns: int) -> None:
        p = self._settings
        dt = (stamp_ns - self._last_stamp_ns) * 1e-9
        paused = not 0.0 < dt <= p.command_timeout
        if source != self._source or paused:
            self._blend.change(self._shaft_angles() if self._source == NOBODY or paused else None)
            self._source = source
        self._last_stamp_ns = stamp_ns
        drive = self._blend.step(wanted, 0.001 if paused else dt)
        limit = p.drive_limit
        if max(drive) > limit or min(drive) < -limit:
            self._saturated += 1
            drive = tuple(min(limit, max(-limit, d)) for d in drive)
        self._motors.publish(stamp_ns, *(p.gear * d for d in drive))

    def _shaft_angles(self) -> tuple[float, ...] | None:
        shafts = self._shafts.read()
        if shafts is None or not shafts.position:
            return None
        return tuple(x / self._settings.gear for x in shafts.position)

    def _report(self) -> Report:
        return OK, f'{self._source} drives', {
            'published': self._motors.count, 'saturated': self._saturated}


def main() -> int:
    """Run the compensator in a process of its own."""
    return run_nodes([CompensatorNode])
