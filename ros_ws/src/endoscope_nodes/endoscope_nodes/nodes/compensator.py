"""Turns desired bending into motor commands that make up for the hysteresis."""

from typing import NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter

from endoscope_core.choices import ADAPTIVE_PHYSICAL, BY_ADOPTED, BY_CLASS
from endoscope_core.control import (
    AdoptedPlant,
    AdoptionError,
    Corrections,
    DesiredMotion,
    Feedforward,
    FeedforwardLaw,
    FeedforwardSettings,
    MotorLimits,
)
from endoscope_core.errors import EndoscopeError
from endoscope_core.identification.law_choice import CalibrationFindings, LawChoice
from endoscope_core.safety import (
    AdoptionCode,
    BendingRange,
    CommandGate,
    CommandLimits,
    MotionLimits,
    MotionShaper,
    Refusal,
    StandingStill,
    keep_within,
    ranges_in_words,
)
from endoscope_nodes import names
from endoscope_nodes.client.calibration_result import findings_of, is_of_no_class
from endoscope_nodes.client.compensator_state import compensator_state, model_in_words
from endoscope_nodes.nodes.plant_adoption import PlantAdoption, Selection
from endoscope_nodes.runtime.diagnostics import ERROR, OK, WARN, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import FOR_SESSION, CompensatorParameters
from endoscope_nodes.runtime.qos import COMMAND, RESULT
from endoscope_nodes.runtime.streams import JointPublisher, JointSample
from endoscope_nodes.runtime.ticker import TICK_S
from endoscope_nodes.safety.sessions import TURN_S, ClutchWatch, CommandInput, SessionWatch
from endoscope_nodes.safety.streams import CommandReport

CALIBRATION = 'calibration'
NOBODY = 'nobody'

_AT_ZERO = (0.0,) * len(names.JOINTS)
_NOTHING = np.zeros(len(names.JOINTS))
_ANY_CLASS = CalibrationFindings(class_deg=70)
# The servo has followed a command by then but for 1 %: 6 / wm of the nominal one.
_REST_NS = 200_000_000


class _Step(NamedTuple):
    """A command that is obeyed."""

    seconds: float  # since the command before; a tick for the first of a stream
    begins: bool = False  # whether it is the first of a stream


class CompensatorNode(EndoscopeNode):
    """The only publisher of ``motor/servo_jp``.

    It obeys commands and corrections of the motion session that it takes part in, each from one
    sender.  Calibration goes before the master while its commands are fresh, and passes
    uncompensated.  Every stream begins at the measured pose, and the motors go on from where they
    are, whatever changes: source, model, parameters or feedback.  A master that falls silent while
    the clutch is held ends the session.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('compensator', context)
        p = self._settings = self.parameters(CompensatorParameters, self._on_parameters)
        facts, motors = self.rig.joints, self.rig.motors
        timeout_ns = self.rig.timeouts.command_ns
        limits = CommandLimits(facts.reach, facts.speed, facts.entry_step, timeout_ns)
        self.gate, self.calibration_gate = CommandGate(limits), CommandGate(limits)
        self.correction_gate = CommandGate(
            CommandLimits(facts.correction, motors.speed / facts.gear, facts.correction, timeout_ns)
        )
        most = (facts.drive * facts.gear, motors.speed, motors.acceleration, motors.step)
        self.shaper = MotionShaper(MotionLimits.either_way(len(names.MOTORS), *most))
        settings = FeedforwardSettings(
            MotorLimits.of(self.rig), lead=p.lead, speed_limit=motors.speed / facts.gear
        )
        self._feedforward = Feedforward(len(names.JOINTS), settings)
        self._passing = Feedforward(len(names.JOINTS), settings)
        self._desired = DesiredMotion(len(names.JOINTS))
        self._choice = LawChoice(len(names.JOINTS), p.parameter_sets, p.table)
        self._trouble = self._load()
        self.findings: CalibrationFindings | None = None
        self._found: CalibrationFindings | None = None
        self._news = False
        self._calibrated_in = ''
        self._learnt_ns = self._last_stamp_ns = self._moved_ns = 0
        self._source = NOBODY
        self._sent = self._rested_at = self._angle = _AT_ZERO
        self._by_adopted = False
        self._answer = StandingStill(names.MOTORS, self.rig.motors.resolution)
        self._corrections = Corrections(timeout_ns)
        self._corrected = False
        self._beyond_range = self._beyond_before = 0
        self._state_is_news = True
        self._motors = JointPublisher(
            self, names.MOTOR_COMMAND, names.MOTORS, ('position',), COMMAND
        )
        self._states = self.create_publisher(DiagnosticArray, names.COMPENSATOR_STATE, RESULT)
        self._session = SessionWatch(self, self._restart, self._restart)
        self._clutch = ClutchWatch(self, self._session, self._end_stream)
        self._pose = context.pose_of(self)
        for topic, gate, take in (
            (names.CALIBRATION_COMMAND, self.calibration_gate, self._on_calibration),
            (names.SLAVE_COMMAND, self.gate, self._on_master),
            (names.CORRECTION, self.correction_gate, self._on_correction),
        ):
            CommandInput(self, self._session, topic, gate, take)
            if gate is not self.correction_gate:
                self._session.obeys(topic, gate)
        results = self.create_subscription(
            DiagnosticArray, names.CALIBRATION_RESULT, self._on_result, RESULT
        )
        self._results = self._session.senders_of(results, self._doubt_results)
        self._adoption = PlantAdoption(
            self, self._session, self._obstacle, self._selection, self._reselect, self._ranges
        )
        add, ticker = self.diagnostics.add, self.ticker
        add('commands', CommandReport(self.gate, ticker, self._session.leave))
        add('calibration commands', CommandReport(self.calibration_gate, ticker))
        add('corrections', CommandReport(self.correction_gate, ticker))
        add('output', self._report)
        self.ticker.every(TURN_S, self._watch_motion)
        self.ticker.every(0.1, self._publish_state)

    def _on_parameters(self, parameters: CompensatorParameters) -> None:
        if self._settings.for_session and not parameters.for_session:
            self._adoption.end_session()
        self._settings = parameters
        self._select_law()
        self._adoption.tell()

    def _selection(self) -> Selection:
        return self._settings.mode, self._settings.selected_by

    def _reselect(self, selection: Selection) -> None:
        mode, selected_by = selection
        wanted: dict[str, str | bool] = {'mode': mode, 'selected_by': selected_by}
        if self._settings.for_session:
            wanted |= {FOR_SESSION: True}
        self.set_parameters_atomically([Parameter(k, value=v) for k, v in wanted.items()])
        # Another plant may be in force under the same selection.
        self._select_law()

    def _obstacle(self, plant: AdoptedPlant | None) -> None:
        """Refuse to adopt, or to go back to, a plant while the slave moves or is bent too far."""
        moving = self.ticker.monotonic_ns() - self._moved_ns < _REST_NS
        if moving or self._source == CALIBRATION:
            raise AdoptionError(
                AdoptionCode.MOVING, 'the slave is moving: plants are exchanged only at rest'
            )
        bending = self._pose.bending()
        if bending is None:
            raise AdoptionError(
                AdoptionCode.NOT_MEASURED, f'{names.MOTOR_MEASURED} is silent: no pose is known'
            )
        before = self._angle if self._source == names.MASTER_NODE else bending
        if plant is not None:
            plant.check_within(before, names.JOINTS)

    def _on_result(self, message: DiagnosticArray) -> None:
        found = findings_of(message)
        if found is None and not is_of_no_class(message):
            return
        rivals = self._results.rivals()
        if rivals:
            self._doubt_results(rivals)
        if rivals or not self._calibrated_in or message.header.frame_id != self._calibrated_in:
            why = rivals or f'it is of {message.header.frame_id or "no session"}'
            self.get_logger().warning(f'{names.CALIBRATION_RESULT} is not taken: {why}')
            return
        self._found, self._news = found, True

    def _doubt_results(self, rivals: str) -> None:
        """Take no result before another calibration: it may be somebody else's."""
        self._calibrated_in = ''
        self._session.leave(rivals)

    def _take_news(self) -> None:
        """Put a new calibration in force: only where nothing moves."""
        if self._news:
            self._news = False
            self.findings = self._found
            self._select_law()

    def _load(self) -> str:
        """Load what the first command would wait for; why the mode is not available."""
        try:
            law = self._choice.law(self._settings.mode, BY_CLASS, _ANY_CLASS)
            self._feedforward.compile(law)
        except EndoscopeError as error:
            return str(error)
        return ''

    def _select_law(self) -> None:
        """Put mode and findings in force; without findings nothing is compensated."""
        law, self._trouble, adopted = FeedforwardLaw(), '', self._adoption.plant
        if self._is_known:
            try:
                law = self._choice.law(
                    *self._selection(),
                    self.findings or CalibrationFindings(),
                    () if adopted is None else adopted.parameters,
                )
            except EndoscopeError as error:
                self._trouble = str(error)
        if law != self._feedforward.law:
            self._feedforward.compile(law)
            self._feedforward.select(law)
        self._by_adopted = adopted is not None and law == adopted.law
        self._state_is_news = True

    @property
    def _is_known(self) -> bool:
        """Whether what selects the feed-forward has been found: a calibration, but for a plant."""
        return self.findings is not None or self._settings.selected_by == BY_ADOPTED

    def _ranges(self) -> tuple[BendingRange, ...]:
        """How far each joint may be bent now, in rad; empty where that is not known."""
        if self._by_adopted and self._adoption.plant is not None:
            return self._adoption.plant.ranges
        return () if self.findings is None else self.findings.ranges

    def _restart(self) -> None:
        for gate in (self.gate, self.calibration_gate, self.correction_gate):
            gate.reset()
        self._corrections.restart()
        self._source = NOBODY
        self._motors.session = self._session.name

    def _end_stream(self) -> None:
        """The clutch was let go of: whatever is commanded after it begins at the measured pose."""
        self.gate.reset()
        if self._source == names.MASTER_NODE:
            self._source = NOBODY

    def _watch_motion(self) -> None:
        now = self.ticker.monotonic_ns()
        if self._source == names.MASTER_NODE and not self.gate.is_fresh(now):
            self._source = NOBODY
            if self._clutch.held:
                said = f' ({self.gate.last_reason})' if self.gate.last_reason else ''
                self._session.leave(f'{names.SLAVE_COMMAND} ended while the clutch was held{said}')
        elif self._source == CALIBRATION and not self.calibration_gate.is_fresh(now):
            self._source = NOBODY
        if self._source == NOBODY:
            self._take_news()
            return
        # By the time of the measurement: motors that are silent do not stand still, and silence
        # has a reason of its own.
        trouble = self._answer.look(self._sent, self._pose.shafts(), self._pose.shafts_ns)
        if trouble:
            self._session.leave(trouble)

    def _learn(self, stamp_ns: int) -> None:
        """Give a measurement from before this command to the law, once."""
        sample = self._pose.tracked
        if sample is None or not self._learnt_ns < sample.stamp_ns < stamp_ns:
            return
        self._learnt_ns = sample.stamp_ns
        self._feedforward.measure((stamp_ns - sample.stamp_ns) * 1e-9, sample.position)

    def _on_correction(self, sample: JointSample) -> None:
        now = self.ticker.monotonic_ns()
        if self.correction_gate.check(sample.stamp_ns, sample.position, now, _AT_ZERO) is None:
            self._corrections.add(sample.stamp_ns, sample.position)

    def _on_master(self, sample: JointSample) -> None:
        if self.calibration_gate.is_fresh(self.ticker.monotonic_ns()):
            return
        if not self._clutch.held:
            self.gate.refuse(Refusal.CLUTCH)
            return
        step = self._obey(names.MASTER_NODE, self.gate, sample, self._pose.bending())
        if step is None:
            return
        # This mode learns from the tracker itself.
        learns = self._feedforward.law.mode == ADAPTIVE_PHYSICAL
        correction = None if learns else self._corrections.before(sample.stamp_ns)
        if step.begins:
            self._desired.restart()
        added = _NOTHING if correction is None else correction
        if step.begins or self._corrected != (correction is not None):
            self._corrected = correction is not None
            self._feedforward.rebase(
                self._drive_before() - added, sample.position if step.begins else None
            )
        # Cut where the tube at hand lets the tip bend no more.
        within = keep_within(self._ranges(), sample.position, sample.velocity)
        self._angle = within[0]
        self._beyond_range += self._angle != sample.position
        angle, velocity = self._desired.follow(*within, step.seconds)
        if self._news and not any(velocity):
            self._take_news()
        self._learn(sample.stamp_ns)
        drive = self._feedforward.step(angle, velocity, step.seconds) + added
        self._put_out(sample.stamp_ns, drive, step.seconds)

    def _on_calibration(self, sample: JointSample) -> None:
        shafts = self._pose.shafts()
        start = None if shafts is None else tuple(x / self.rig.joints.gear for x in shafts)
        step = self._obey(CALIBRATION, self.calibration_gate, sample, start)
        if step is None:
            return
        self._calibrated_in = self._session.name
        if step.begins:
            self._passing.rebase(self._drive_before(), sample.position)
        velocity = sample.velocity or _AT_ZERO
        drive = self._passing.step(sample.position, velocity, step.seconds)
        self._put_out(sample.stamp_ns, drive, step.seconds)

    def _obey(
        self,
        source: str,
        gate: CommandGate,
        sample: JointSample,
        measured: tuple[float, ...] | None,
    ) -> _Step | None:
        """The step that a command asks for; None if it is refused."""
        now = self.ticker.monotonic_ns()
        shafts = self._pose.shafts()
        if measured is None or shafts is None:
            gate.refuse(Refusal.STEP, 'no measured position')
            return None
        if gate.check(sample.stamp_ns, sample.position, now, measured, sample.velocity) is not None:
            return None
        goes_on = source == self._source and not gate.began
        dt = (sample.stamp_ns - self._last_stamp_ns) * 1e-9
        self._last_stamp_ns = sample.stamp_ns
        self._source = source
        if goes_on:
            return _Step(dt)
        self._sent = shafts
        self.shaper.restart(shafts)
        self._answer.restart()
        return _Step(TICK_S, begins=True)

    def _put_out(self, stamp_ns: int, drive: np.ndarray, dt: float) -> None:
        gear = self.rig.joints.gear
        self._sent = self.shaper.shape([gear * angle for angle in drive.tolist()], dt)
        away = max(abs(a - b) for a, b in zip(self._sent, self._rested_at, strict=True))
        if away > self.rig.motors.resolution:
            self._rested_at, self._moved_ns = self._sent, self.ticker.monotonic_ns()
        self._motors.publish(stamp_ns, *self._sent)

    def _drive_before(self) -> np.ndarray:
        """Joint-equivalent angles that went out last, or that a stream begins at, in rad."""
        return np.array(self._sent) / self.rig.joints.gear

    def _publish_state(self) -> None:
        now = self.ticker.now_ns()
        if now == 0 or not self._state_is_news:
            return
        self._state_is_news = False
        law, gear = self._feedforward.law, self.rig.joints.gear
        words = self._model_in_words()
        self._states.publish(
            compensator_state(now, law, self._settings, gear, self.findings, words)
        )

    def _model_in_words(self) -> str:
        plant, remedy = self._adoption.plant, self.operate('calibrate')
        return model_in_words(self._settings, self._trouble, plant, self.findings, remedy)

    def close(self) -> None:
        """Let the thread end in which plants are tried."""
        self._adoption.close()

    def _report(self) -> Report:
        waiting = self._settings.mode != 'none' and not self._is_known
        level = ERROR if self._trouble else WARN if waiting else OK
        said = self._model_in_words()
        beyond = self._beyond_range - self._beyond_before
        self._beyond_before = self._beyond_range
        if beyond:
            level = max(level, WARN)
            said += f'; {ranges_in_words(self._ranges(), names.JOINTS)}, more was asked for'
        learnt = (f'{each.joint.capstan_exponent:.3f}' for each in self._feedforward.learnt)
        values: dict[str, object] = {
            'cut to the reach': self._beyond_range,
            'source': self._source,
            'published': self._motors.count,
            'corrected': self._corrected,
            'bounded': self.shaper.bounded,
            'learnt': ' '.join(learnt),
        }
        return level, said, values
