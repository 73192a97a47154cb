"""Decides in which state the slave is, opens motion sessions, watches what may go wrong."""

import math

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.time import Time
from std_msgs.msg import Header, String

from endoscope_core.safety import (
    Answer,
    OperatingState,
    OperatingStateMachine,
    StateCommand,
    TensionGuard,
)
from endoscope_core.safety.motion_session import HEARTBEAT_S
from endoscope_nodes import names
from endoscope_nodes.runtime.diagnostics import ERROR, OK, WARN, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.qos import EVENT, RESULT, SENSOR_ASKED
from endoscope_nodes.runtime.streams import JointSample, JointSubscription
from endoscope_nodes.safety.sessions import SESSION_REPORT, senders_in_words
from endoscope_nodes.safety.streams import StreamWatch
from endoscope_nodes.safety.velocities import rivals_in_motion
from endoscope_nodes.topics import TOPICS

# Subcomponents whose errors forbid motion; their nodes report them at once.
_VITAL = ('motor_driver: device', 'load_cells: cells')


class SupervisorNode(EndoscopeNode):
    """Publishes ``slave/operating_state`` and ``slave/motion_session``, obeys state commands.

    An ``enable`` opens a motion session, whose name it repeats at 20 Hz; a fault, ``disable`` and
    ``pause`` end it. Faults are a wire over its ceiling, silent motors or load cells, an error of a
    vital device, a node that has left the session, and a second sender on a topic that has one.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('supervisor', context)
        self._timeout_ns = self.rig.timeouts.stream_ns
        self.machine = OperatingStateMachine()
        self._guard = TensionGuard(names.WIRES, self.rig.tension.ceiling)
        joints = self.rig.joints
        self._in_force = {
            names.GEAR: joints.gear,
            names.REACH: joints.reach,
            names.SPEED: joints.speed,
            names.CEILING: self.rig.tension.ceiling,
        }
        self._refused, self._refused_ns = Answer(True), 0
        self._own = f'{self.get_namespace().rstrip("/")}/'
        self._watched = [self.resolve_topic_name(t.name) for t in TOPICS if t.one_sender]
        self._states = self.create_publisher(String, names.OPERATING_STATE, RESULT)
        self._sessions = self.create_publisher(Header, names.MOTION_SESSION, EVENT)
        self._motor = StreamWatch.of(self, names.MOTOR_MEASURED, SENSOR_ASKED)
        self._wires = StreamWatch(self.ticker, names.WIRES_MEASURED)
        self._streams = self._motor, self._wires
        JointSubscription(self, names.WIRES_MEASURED, names.WIRES, self._on_wires, SENSOR_ASKED)
        self.create_subscription(
            String, names.STATE_COMMAND, lambda message: self._command(message.data), EVENT
        )
        self.serve(names.SLAVE_STOP, self._stop)
        self.create_subscription(DiagnosticArray, names.DIAGNOSTICS, self._on_diagnostics, EVENT)
        self.diagnostics.add('operating state', self._report)
        self.ticker.every(HEARTBEAT_S, self._beat)
        self._check()

    @property
    def announcement(self) -> str:
        """Say in which state the slave is, and what to do about it."""
        state = self.machine.state
        if state is OperatingState.DISABLED:
            return f'slave {state}; next: {self.operate("enable")}'
        return f'slave {state}{f" ({self.machine.cause})" if self.machine.cause else ""}'

    @property
    def waiting(self) -> str:
        """Name what forbids motion."""
        return '; '.join(self.machine.present_causes.values())

    def _beat(self) -> None:
        self._check()
        self._publish()

    def _publish(self) -> None:
        now = self.ticker.now_ns()
        if not now:
            return
        self._states.publish(String(data=str(self.machine.state)))
        self._sessions.publish(
            Header(stamp=Time(nanoseconds=now).to_msg(), frame_id=self.machine.session)
        )

    def _stop(self) -> tuple[bool, str]:
        if self.machine.session:
            self._command(StateCommand.PAUSE)
        return True, str(self.machine.state)

    def _command(self, text: str) -> None:
        before, now = self.machine.state, self.ticker.now_ns()
        answer = self.machine.command(text, now)
        if not answer.accepted:
            self._refused, self._refused_ns = answer, now
            self.get_logger().warning(answer.reason)
            # Whoever asked waits for the reason.
            self.diagnostics.publish()
        elif self.machine.state != before:
            self._refused = answer
            self.get_logger().info(f'{before} -> {self.machine.state} {self.machine.session}')
            self._publish()

    def _on_wires(self, sample: JointSample) -> None:
        self._wires.note()
        tension = sample.effort or (math.nan,) * len(names.WIRES)
        self._note('tension', self._guard.update(tension))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if not status.name.startswith(self._own):
                continue
            name = status.name.removeprefix(self._own)
            if name in _VITAL or name.endswith(f': {SESSION_REPORT}'):
                wrong = status.level == ERROR
                self._note(status.name, f'{name}: {status.message}' if wrong else '')

    def _check(self) -> None:
        for watch in self._streams:
            self._note(watch.topic, watch.trouble(self._timeout_ns))
        deserted = self.machine.session and not self.count_publishers(names.MOTOR_COMMAND)
        self._note('compensator', f'nobody sends {names.MOTOR_COMMAND}' if deserted else '')
        for topic in self._watched:
            rivals = self.count_publishers(topic) > 1
            self._note(f'senders of {topic}', senders_in_words(self, topic) if rivals else '')
        self._note('senders of motion', rivals_in_motion(self))

    def _note(self, name: str, trouble: str) -> None:
        if not trouble:
            self.machine.clear_cause(name)
        elif self.machine.report_cause(name, trouble):
            self.get_logger().error(f'{OperatingState.FAULT}: {trouble}')
            self._publish()
            # Once somebody has left a fault, its cause is reported no more.
            self.diagnostics.publish()

    def _report(self) -> Report:
        machine = self.machine
        values: dict[str, object] = {
            'state': machine.state,
            'session': machine.session,
            'cause': machine.cause,
            'present causes': '; '.join(machine.present_causes.values()),
            names.AWAITED: '; '.join(w.trouble(0) for w in self._streams if not w.ever_heard),
            names.REFUSAL: self._refused.reason,
            names.REFUSAL_CODE: self._refused.code,
            names.REFUSED_NS: self._refused_ns,
            'peak tension [N]': self._guard.peak,
            names.TIME: 'simulated' if self.ticker.simulated else 'real',
            **self._in_force,
        }
        if machine.state is OperatingState.FAULT:
            return ERROR, machine.cause, values
        if machine.present_causes:
            return WARN, 'cannot be enabled: ' + '; '.join(machine.present_causes.values()), values
        return OK, str(machine.state), values

    def close(self) -> None:
        """Say that the slave is no longer supervised."""
        self.machine.command('disable', self.ticker.now_ns())
        self._publish()
