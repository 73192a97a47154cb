"""Turns desired bending into motor commands that make up for the hysteresis."""

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.time import Time

from endoscope_core.control import (
    ADAPTIVE_PHYSICAL,
    MODES,
    Feedforward,
    FeedforwardLaw,
    FeedforwardSettings,
)
from endoscope_core.errors import EndoscopeError
from endoscope_core.identification.law_choice import BY_CLASS, CalibrationFindings, LawChoice
from endoscope_core.safety import CommandGate, CommandLimits, Refusal
from endoscope_nodes.calibration_result import findings_of, is_of_no_class
from endoscope_nodes.clutch_watch import ClutchWatch
from endoscope_nodes.command_report import CommandReport
from endoscope_nodes.compensator_parameters import CompensatorParameters
from endoscope_nodes.diagnostics import ERROR, OK, WARN, Report, status
from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.joint_stream import (
    JointPublisher,
    JointSample,
    JointSubscription,
    LatestJointState,
)
from endoscope_nodes.names import (
    CALIBRATION_COMMAND,
    CALIBRATION_RESULT,
    COMPENSATOR_STATE,
    CORRECTION,
    JOINTS,
    MOTOR_COMMAND,
    MOTOR_MEASURED,
    MOTORS,
    SLAVE_COMMAND,
    SLAVE_MEASURED,
)
from endoscope_nodes.qos import COMMAND, RESULT, SENSOR_ASKED
from endoscope_nodes.runtime import Runtime, run_nodes
from endoscope_nodes.state_watch import StateWatch

CONSOLE = 'console'
CALIBRATION = 'calibration'
NOBODY = 'nobody'

_NOTHING = np.zeros(len(JOINTS))
_ANY_CLASS = CalibrationFindings(class_deg=70)


class CompensatorNode(EndoscopeNode):
    """The only publisher of ``motor/servo_jp``.

    Calibration goes before the console while its commands are fresh, and passes uncompensated.
    Whatever changes, source, model, parameters or feedback, the motors go on from what was put out
    before, or after a pause from where they are.
    """

    def __init__(self, runtime: Runtime) -> None:
        super().__init__('compensator', runtime)
        p = self.parameters(CompensatorParameters, self._on_parameters)
        self._settings = p
        self.gate = CommandGate(self._limits(p.command_timeout, p.max_step))
        # A calibration begins wherever the shafts are.
        self.calibration_gate = CommandGate(
            self._limits(p.calibration_timeout, 2.0 * p.joint_limit)
        )
        self._feedforward = Feedforward(len(JOINTS), FeedforwardSettings(lead=p.lead))
        self._passing = Feedforward(len(JOINTS))
        self._choice = LawChoice(len(JOINTS), p.parameter_sets, p.table)
        self._trouble = self._load()
        self.findings: CalibrationFindings | None = None
        self._measurement: JointSample | None = None
        self._source = NOBODY
        self._last_stamp_ns = 0
        self._drive_before = _NOTHING
        self._corrections: tuple[JointSample | None, JointSample | None] = (None, None)
        self._corrected = False
        self._saturated = 0
        self._state_is_news = True
        self._motors = JointPublisher(self, MOTOR_COMMAND, MOTORS, ('position',), COMMAND)
        self._states = self.create_publisher(DiagnosticArray, COMPENSATOR_STATE, RESULT)
        self._state = StateWatch(self, self.ticker, lambda _: self._start_anew())
        self._clutch = ClutchWatch(self, self.ticker)
        self._shafts = LatestJointState(self, MOTOR_MEASURED, MOTORS, SENSOR_ASKED)
        JointSubscription(
            self,
            CALIBRATION_COMMAND,
            JOINTS,
            self._on_calibration,
            COMMAND,
            exact=True,
            on_malformed=self._on_malformed,
        )
        JointSubscription(
            self,
            SLAVE_COMMAND,
            JOINTS,
            self._on_console,
            COMMAND,
            exact=True,
            on_malformed=self._on_malformed,
        )
        JointSubscription(self, CORRECTION, JOINTS, self._on_correction, COMMAND)
        JointSubscription(self, SLAVE_MEASURED, JOINTS, self._on_measured, SENSOR_ASKED)
        self.create_subscription(DiagnosticArray, CALIBRATION_RESULT, self._on_result, RESULT)
        self.diagnostics.add('commands', CommandReport(self.gate))
        self.diagnostics.add('calibration commands', CommandReport(self.calibration_gate))
        self.diagnostics.add('output', self._report)
        self.ticker.every(0.1, self._publish_state)

    def _limits(self, timeout: float, max_step: float) -> CommandLimits:
        reach = (self._settings.joint_limit,) * len(JOINTS)
        return CommandLimits(
            tuple(-x for x in reach),
            reach,
            self._settings.max_speed,
            max_step,
            round(timeout * 1e9),
        )

    def _on_parameters(self, parameters: CompensatorParameters) -> None:
        self._settings = parameters
        self._select_law()

    def _on_result(self, message: DiagnosticArray) -> None:
        found = findings_of(message)
        if found is not None or is_of_no_class(message):
            self.findings = found
            self._select_law()

    def _load(self) -> str:
        """Read what the mode needs and load what is compiled: the first command must not wait.

        Returns why the mode cannot be had, empty if it can.
        """
        trouble = ''
        for mode in dict.fromkeys((*MODES, self._settings.mode)):
            trial = Feedforward(len(JOINTS))
            try:
                trial.select(self._choice.law(mode, BY_CLASS, _ANY_CLASS))
            except EndoscopeError as error:
                trouble = str(error) if mode == self._settings.mode else trouble
                continue
            trial.step(_NOTHING, _NOTHING, 1e-3)
            trial.measure(0.0, _NOTHING)
        return trouble

    def _select_law(self) -> None:
        """Put mode and findings in force; without findings nothing is compensated."""
        law, self._trouble = FeedforwardLaw(), ''
        if self.findings is not None:
            try:
                law = self._choice.law(
                    self._settings.mode, self._settings.selected_by, self.findings
                )
            except EndoscopeError as error:
                self._trouble = str(error)
        if law != self._feedforward.law:
            self._feedforward.select(law)
        self._state_is_news = True

    def _start_anew(self) -> None:
        self.gate.reset()
        self.calibration_gate.reset()
        self._source = NOBODY

    def _on_malformed(self, reason: str) -> None:
        self.gate.refuse(Refusal.MALFORMED, reason)

    def _on_measured(self, sample: JointSample) -> None:
        if len(sample.position) == len(JOINTS):
            self._measurement = sample

    def _learn(self, stamp_ns: int) -> None:
        """Give a measurement from before this command to the law, once."""
        sample = self._measurement
        if sample is None or sample.stamp_ns >= stamp_ns:
            return
        self._measurement = None
        if np.isfinite(sample.position).all():
            self._feedforward.measure((stamp_ns - sample.stamp_ns) * 1e-9, sample.position)

    def _on_correction(self, sample: JointSample) -> None:
        self._corrections = (self._corrections[1], sample)

    def _on_console(self, sample: JointSample) -> None:
        now = self.ticker.monotonic_ns()
        if not self._state.enabled:
            self.gate.refuse(Refusal.NOT_ENABLED)
            return
        if self.calibration_gate.is_fresh(now):
            return
        if not self._clutch.held:
            self.gate.refuse(Refusal.CLUTCH)
            return
        if self.gate.check(sample.stamp_ns, sample.position, sample.velocity, now) is not None:
            return
        dt = self._take_over(CONSOLE, sample.stamp_ns)
        correction = self._correction(sample.stamp_ns)
        if dt is None or (correction is None and self._corrected):
            self._corrected = False
            self._feedforward.rebase(
                self._drive_before - (_NOTHING if correction is None else correction)
            )
        self._learn(sample.stamp_ns)
        velocity = sample.velocity or (0.0,) * len(JOINTS)
        drive = self._feedforward.step(sample.position, velocity, dt or 1e-3)
        if correction is not None:
            self._corrected = True
            drive = drive + correction
        self._put_out(sample.stamp_ns, drive)

    def _on_calibration(self, sample: JointSample) -> None:
        now = self.ticker.monotonic_ns()
        if not self._state.enabled:
            self.calibration_gate.refuse(Refusal.NOT_ENABLED)
            return
        if (
            self.calibration_gate.check(sample.stamp_ns, sample.position, sample.velocity, now)
            is not None
        ):
            return
        dt = self._take_over(CALIBRATION, sample.stamp_ns)
        if dt is None:
            self._passing.rebase(self._drive_before)
        velocity = sample.velocity or (0.0,) * len(JOINTS)
        self._put_out(sample.stamp_ns, self._passing.step(sample.position, velocity, dt or 1e-3))

    def _take_over(self, source: str, stamp_ns: int) -> float | None:
        """Seconds since the command before, None if this one is the first of its source."""
        dt = (stamp_ns - self._last_stamp_ns) * 1e-9
        self._last_stamp_ns = stamp_ns
        paused = not 0.0 < dt <= self._settings.command_timeout or self._source == NOBODY
        if not paused and source == self._source:
            return dt
        self._source = source
        if paused:
            shafts = self._shafts.read()
            if shafts is not None and shafts.position:
                self._drive_before = np.array(shafts.position) / self._settings.gear
        return None

    def _correction(self, stamp_ns: int) -> np.ndarray | None:
        """Newest correction from before this command: which one must not depend on chance.

        None in the mode that learns from the tracker itself.
        """
        if self._feedforward.law.mode == ADAPTIVE_PHYSICAL:
            return None
        for sample in reversed(self._corrections):
            if sample is not None and sample.stamp_ns < stamp_ns:
                age = (stamp_ns - sample.stamp_ns) * 1e-9
                correction = np.array(sample.position)
                if age > self._settings.command_timeout or not np.isfinite(correction).all():
                    return None
                return correction if correction.shape == _NOTHING.shape else None
        return None

    def _put_out(self, stamp_ns: int, drive: np.ndarray) -> None:
        limit = self._settings.drive_limit
        self._drive_before = drive
        shafts = (drive * self._settings.gear).tolist()
        if max(shafts) > limit * self._settings.gear or min(shafts) < -limit * self._settings.gear:
            self._saturated += 1
            shafts = (np.clip(drive, -limit, limit) * self._settings.gear).tolist()
        self._motors.publish(stamp_ns, *shafts)

    def _publish_state(self) -> None:
        now = self.ticker.now_ns()
        if now == 0 or not self._state_is_news:
            return
        self._state_is_news = False
        law = self._feedforward.law
        values: dict[str, object] = {
            'mode': law.mode,
            'wanted_mode': self._settings.mode,
            'selected_by': self._settings.selected_by,
            'lead': self._settings.lead,
            'gear': self._settings.gear,
        }
        if self.findings is not None and self.findings.class_deg is not None:
            values['class_deg'] = self.findings.class_deg
        for joint, parameters in zip(JOINTS, law.parameters, strict=False):
            values |= {f'{joint}.{key}': value for key, value in parameters.to_dict().items()}
        message = DiagnosticArray()
        message.header.stamp = Time(nanoseconds=now).to_msg()
        message.status = [status('compensator: model', OK, self._model_in_words(), values)]
        self._states.publish(message)

    def _model_in_words(self) -> str:
        if self._settings.mode == 'none':
            return 'no feed-forward'
        if self._trouble:
            return f'no feed-forward: {self._trouble}'
        if self.findings is None:
            return f'no feed-forward: {self._settings.mode} waits for {CALIBRATION_RESULT}'
        return f'{self._settings.mode} by {self._settings.selected_by}: {_in_words(self.findings)}'

    def _report(self) -> Report:
        waiting = self._settings.mode != 'none' and self.findings is None
        level = ERROR if self._trouble else WARN if waiting else OK
        return (
            level,
            self._model_in_words(),
            {
                'source': self._source,
                'published': self._motors.count,
                'corrected': self._corrected,
                'saturated': self._saturated,
                'learnt': ' '.join(
                    f'{learnt.joint.capstan_exponent:.3f}' for learnt in self._feedforward.learnt
                ),
            },
        )


def _in_words(findings: CalibrationFindings) -> str:
    parts = [] if findings.class_deg is None else [f'class {findings.class_deg} deg']
    if findings.size is not None:
        parts.append(f'size {np.degrees(findings.size):.1f} deg')
    return ', '.join([*parts, *(['plant identified'] if findings.plants else [])])


def main() -> int:
    """Run the compensator in a process of its own."""
    return run_nodes([CompensatorNode])
