"""Feedback from the tracker: what the feed-forward leaves over, learnt while it moves."""

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray

from endoscope_core.control import AdaptiveBacklashController, DesiredMotion, TrackerMeasurement
from endoscope_core.safety import CommandGate, CommandLimits, Refusal
from endoscope_nodes import names
from endoscope_nodes.client.calibration_result import findings_of
from endoscope_nodes.runtime.diagnostics import OK, WARN, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import ControllerParameters
from endoscope_nodes.runtime.qos import COMMAND, RESULT
from endoscope_nodes.runtime.streams import JointPublisher, JointSample
from endoscope_nodes.runtime.ticker import TICK_S
from endoscope_nodes.safety.sessions import SessionWatch
from endoscope_nodes.safety.streams import CommandReport, StreamWatch

_NOTHING = np.zeros(len(names.JOINTS))


class ControllerNode(EndoscopeNode):
    """Publishes ``controller/correction_js``, to be added to the joint-equivalent motor command.

    It answers every command of the master that may be obeyed, with a correction of zero while it
    does not act: without a fresh tracker, during a calibration, or when it is not active.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('controller', context)
        p = self.parameters(ControllerParameters, self._on_parameters)
        self._settings = p
        self.controller = AdaptiveBacklashController(
            len(names.JOINTS), stale_after=p.tracker_timeout, fade_time=p.fade_time
        )
        # Loads what is compiled now, which the second step needs: no command must wait for it.
        trial = AdaptiveBacklashController(len(names.JOINTS))
        for time in (0.0, 1e-3):
            trial.step(time, _NOTHING, _NOTHING)
        facts, self._timeout_ns = self.rig.joints, self.rig.timeouts.command_ns
        self._gate = CommandGate(
            CommandLimits(facts.reach, facts.speed, facts.entry_step, self._timeout_ns)
        )
        self._desired = DesiredMotion(len(names.JOINTS))
        self._used_ns = 0
        self._last_stamp_ns = 0
        self._forget = False
        self._reported = 0
        self._corrections = JointPublisher(
            self, names.CORRECTION, names.JOINTS, ('position',), COMMAND
        )
        self._session = SessionWatch(self, self._restart, self._restart)
        self._pose = context.pose_of(self)
        self._calibration = StreamWatch.of(self, names.CALIBRATION_COMMAND, COMMAND)
        self._session.commands(names.SLAVE_COMMAND, self._gate, self._on_command)
        self.create_subscription(DiagnosticArray, names.CALIBRATION_RESULT, self._on_result, RESULT)
        self.diagnostics.add('commands', CommandReport(self._gate, self.ticker))
        self.diagnostics.add('feedback', self._report)

    def _on_parameters(self, parameters: ControllerParameters) -> None:
        self._settings = parameters

    def _restart(self) -> None:
        self._gate.reset()
        self.controller.restart()
        self._last_stamp_ns = 0
        self._corrections.session = self._session.name

    def _on_result(self, message: DiagnosticArray) -> None:
        self._forget = self._forget or findings_of(message) is not None

    def _on_command(self, sample: JointSample) -> None:
        now = self.ticker.monotonic_ns()
        bending = self._pose.bending()
        if bending is None:
            self._gate.refuse(Refusal.STEP, 'no measured position')
            return
        if (
            self._gate.check(sample.stamp_ns, sample.position, now, bending, sample.velocity)
            is not None
        ):
            return
        dt = (sample.stamp_ns - self._last_stamp_ns) * 1e-9
        if self._gate.began:
            self.controller.restart()
            self._desired.restart()
            dt = TICK_S
        self._last_stamp_ns = sample.stamp_ns
        self._choose_whether_to_act()
        angle, velocity = self._desired.follow(sample.position, sample.velocity, dt)
        correction = self.controller.step(
            sample.stamp_ns * 1e-9, angle, velocity, self._fresh(sample.stamp_ns)
        )
        self._corrections.publish(sample.stamp_ns, *correction.tolist())

    def _choose_whether_to_act(self) -> None:
        calibrating = self._calibration.heard(self._timeout_ns)
        if self._settings.active and not calibrating:
            self.controller.activate()
        else:
            self.controller.deactivate()
        if self._forget:
            self.controller.forget()
            self._forget = False

    def _fresh(self, stamp_ns: int) -> TrackerMeasurement | None:
        """A measurement from before this command that has not been used yet."""
        sample = self._pose.tracked
        if sample is None or not self._used_ns < sample.stamp_ns < stamp_ns:
            return None
        self._used_ns = sample.stamp_ns
        return TrackerMeasurement(sample.stamp_ns * 1e-9, np.array(sample.position))

    def _report(self) -> Report:
        controller = self.controller
        values: dict[str, object] = {
            'published': self._corrections.count,
            'weight': controller.weight,
            'measurements refused': controller.refused,
        }
        for joint, (gain, backlash) in zip(names.JOINTS, controller.learnt, strict=True):
            values |= {f'{joint}.gain': gain, f'{joint}.backlash': backlash}
        if not self._settings.active:
            return OK, 'not active', values
        if not self._pose.tracks:
            return WARN, f'{names.SLAVE_MEASURED} is silent: feed-forward alone', values
        # Measurements are taken with commands: at rest none of them is fresh, however many come.
        idle = self._corrections.count == self._reported
        self._reported = self._corrections.count
        if idle:
            return OK, f'waiting for {names.SLAVE_COMMAND}', values
        if not controller.tracker_fresh(self._last_stamp_ns * 1e-9):
            return WARN, f'{names.SLAVE_MEASURED} is not believed: feed-forward alone', values
        return OK, 'in the loop', values
