"""Decides in which operating state the slave is, and watches what must not go wrong."""

import math
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from endoscope_core.safety import OperatingState, OperatingStateMachine, TensionGuard
from endoscope_nodes.diagnostics import ERROR, OK, WARN, Report
from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.joint_stream import JointSample, JointSubscription
from endoscope_nodes.names import (
    MOTOR_MEASURED,
    OPERATING_STATE,
    STATE_COMMAND,
    WIRES,
    WIRES_MEASURED,
)
from endoscope_nodes.parameters import parameter
from endoscope_nodes.qos import EVENT, RESULT, SENSOR_ASKED
from endoscope_nodes.runtime import Runtime, run_nodes
from endoscope_nodes.stream_watch import StreamWatch

# Subcomponents whose errors forbid motion; their nodes tell them at once.
_VITAL = frozenset(('motor_driver: device', 'load_cells: cells'))


@dataclass(frozen=True)
class SupervisorParameters:
    """Parameters of the supervisor."""

    tension_ceiling: float = parameter(
        60.0, 'tension of a wire at which the slave goes to FAULT', unit='N', low=0.1, high=500.0
    )
    stream_timeout: float = parameter(
        0.25,
        'silence of motors or load cells at which the slave goes to FAULT',
        unit='s',
        low=0.005,
        high=10.0,
    )
    check_period: float = parameter(
        0.02, 'how often silence is looked for', unit='s', low=0.001, high=1.0
    )


class SupervisorNode(EndoscopeNode):
    """Publishes ``slave/operating_state``, obeys ``slave/state_command``."""

    def __init__(self, runtime: Runtime) -> None:
        super().__init__('supervisor', runtime)
        p = self.parameters(SupervisorParameters)
        self._timeout_ns = round(p.stream_timeout * 1e9)
        self.machine = OperatingStateMachine()
        self._guard = TensionGuard(WIRES, p.tension_ceiling)
        self._last_refusal = ''
        self._said: OperatingState | None = None
        self._states = self.create_publisher(String, OPERATING_STATE, RESULT)
        self._motor = StreamWatch(self.ticker, MOTOR_MEASURED)
        self._wires = StreamWatch(self.ticker, WIRES_MEASURED)
        self.create_subscription(
            JointState, MOTOR_MEASURED, self._motor.note, SENSOR_ASKED, raw=True
        )
        JointSubscription(self, WIRES_MEASURED, WIRES, self._on_wires, SENSOR_ASKED)
        self.create_subscription(String, STATE_COMMAND, self._on_command, EVENT)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, EVENT)
        self.diagnostics.add('operating state', self._report)
        self.ticker.every(p.check_period, self._check_streams)
        self.ticker.every(1.0, self._publish)
        self._check_streams()

    def _publish(self) -> None:
        self._said = self.machine.state
        self._states.publish(String(data=str(self._said)))

    def _on_command(self, message: String) -> None:
        before = self.machine.state
        answer = self.machine.command(message.data)
        if not answer.accepted:
            self._last_refusal = answer.reason
            self.get_logger().warning(answer.reason)
        elif self.machine.state != before:
            self._last_refusal = ''
            self.get_logger().info(f'{before} -> {self.machine.state}')
            self._publish()

    def _on_wires(self, sample: JointSample) -> None:
        self._wires.note()
        tension = sample.effort or (math.nan,) * len(WIRES)
        trouble = self._guard.update(tension)
        if trouble:
            self._report_cause('tension', trouble)
        else:
            self.machine.clear_cause('tension')

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name not in _VITAL:
                continue
            if status.level == ERROR:
                self._report_cause(status.name, f'{status.name}: {status.message}')
            else:
                self.machine.clear_cause(status.name)

    def _check_streams(self) -> None:
        for watch in (self._motor, self._wires):
            trouble = watch.trouble(self._timeout_ns)
            if trouble:
                self._report_cause(watch.topic, trouble)
            else:
                self.machine.clear_cause(watch.topic)
        if self._said is None and self.ticker.now_ns():
            self._publish()

    def _report_cause(self, name: str, description: str) -> None:
        if self.machine.report_cause(name, description):
            self.get_logger().error(f'{OperatingState.FAULT}: {description}')
            self._publish()

    def _report(self) -> Report:
        machine = self.machine
        values: dict[str, object] = {
            'state': machine.state,
            'cause': machine.cause,
            'present causes': '; '.join(machine.present_causes.values()),
            'last refusal': self._last_refusal,
            'peak tension [N]': self._guard.peak,
        }
        if machine.state is OperatingState.FAULT:
            return ERROR, machine.cause, values
        if machine.present_causes:
            return WARN, 'cannot be enabled: ' + '; '.join(machine.present_causes.values()), values
        return OK, str(machine.state), values

    def close(self) -> None:
        """Say that the slave is no longer supervised."""
        self.machine.command('disable')
        self._publish()


def main() -> int:
    """Run the supervisor in a process of its own."""
    return run_nodes([SupervisorNode])
