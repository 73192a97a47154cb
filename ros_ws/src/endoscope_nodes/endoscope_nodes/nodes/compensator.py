"""Turns desired bending into motor commands that make up for the hysteresis."""

from typing import NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter

from endoscope_core.choices import ADAPTIVE_PHYSICAL, BY_ADOPTED, BY_CLASS
from endoscope_core.control import (
    AdoptedPlant,
    AdoptionError,
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
from endoscope_nodes.nodes.plant_adoption import PlantAdoption, Selection
from endoscope_nodes.runtime.diagnostics import ERROR, OK, WARN, Report, diagnostic_array, status
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
        p = self.parameters(CompensatorParameters, self._on_parameters)
        self._settings = p
        facts, motors = self.rig.joints, self.rig.motors
        timeout_ns = self.rig.timeouts.command_ns
        self.gate = CommandGate(
            CommandLimits(facts.reach, facts.speed, facts.entry_step, timeout_ns)
        )
        self.calibration_gate = CommandGate(
            CommandLimits(facts.reach, facts.speed, facts.entry_step, timeout_ns)
        )
        self.correction_gate = CommandGate(
            CommandLimits(facts.correction, motors.speed / facts.gear, facts.correction, timeout_ns)
        )
        limits = (facts.drive * facts.gear, motors.speed, motors.acceleration, motors.step)
        self.shaper = MotionShaper(MotionLimits.either_way(len(names.MOTORS), *limits))
        settings = FeedforwardSettings(
            MotorLimits.of(self.rig), lead=p.lead, speed_limit=motors.speed / facts.gear
        )
        self._feedforward = Feedforward(len(names.JOINTS), settings)
        self._passing = Feedforward(len(names.JOINTS), settings)
        self._desired = DesiredMotion(len(names.JOINTS))
        self._choice = LawChoice(len(names.JOINTS), p.parameter_sets, p.table)
        self._compiled: set[str] = set()
        self._trouble = self._load()
        self.findings: CalibrationFindings | None = None
        self._found: CalibrationFindings | None = None
        self._news = False
        self._calibrated_in = ''
        self._learnt_ns = 0
        self._source = NOBODY
        self._last_stamp_ns = 0
        self._sent = self._rested_at = _AT_ZERO
        self._moved_ns = 0
        self._angle: tuple[float, ...] = _AT_ZERO
        self._by_adopted = False
        self._answer = StandingStill(names.MOTORS, self.rig.motors.resolution)
        self._corrections: tuple[JointSample | None, JointSample | None] = (None, None)
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
        self.diagnostics.add('commands', CommandReport(self.gate, self.ticker, self._session.leave))
        self.diagnostics.add(
            'calibration commands', CommandReport(self.calibration_gate, self.ticker)
        )
        self.diagnostics.add('corrections', CommandReport(self.correction_gate, self.ticker))
        self.diagnostics.add('output', self._report)
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
        joint = None if plant is None else plant.outside(before)
        if plant is not None and joint is not None:
            within = ranges_in_words(
                plant.ranges[joint : joint + 1], names.JOINTS[joint : joint + 1]
            )
            raise AdoptionError(
                AdoptionCode.BEYOND_RANGE,
                f'{names.JOINTS[joint]} is at {np.degrees(before[joint]):.0f} deg; {within}',
            )

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
            self._compile(self._choice.law(self._settings.mode, BY_CLASS, _ANY_CLASS))
        except EndoscopeError as error:
            return str(error)
        return ''

    def _compile(self, law: FeedforwardLaw) -> None:
        """Compile a mode before a command needs it, once."""
        if law.mode in self._compiled:
            return
        trial = Feedforward(len(names.JOINTS), self._feedforward.settings)
        trial.select(law)
        trial.step(_NOTHING, _NOTHING, 1e-3)
        trial.measure(0.0, _NOTHING)
        self._compiled.add(law.mode)

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
            self._compile(law)
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
        self._corrections = (None, None)
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
            self._corrections = (self._corrections[1], sample)

    def _on_master(self, sample: JointSample) -> None:
        if self.calibration_gate.is_fresh(self.ticker.monotonic_ns()):
            return
        if not self._clutch.held:
            self.gate.refuse(Refusal.CLUTCH)
            return
        step = self._obey(names.MASTER_NODE, self.gate, sample, self._pose.bending())
        if step is None:
            return
        correction = self._correction(sample.stamp_ns)
        if step.begins:
            self._desired.restart()
        added = _NOTHING if correction is None else correction
        if step.begins or self._corrected != (correction is not None):
            self._corrected = correction is not None
            self._feedforward.rebase(
                self._drive_before() - added, sample.position if step.begins else None
            )
        within = self._within_range(sample)
        self._angle = within[0]
        angle, velocity = self._desired.follow(*within, step.seconds)
        if self._news and not any(velocity):
            self._take_news()
        self._learn(sample.stamp_ns)
        drive = self._feedforward.step(angle, velocity, step.seconds) + added
        self._put_out(sample.stamp_ns, drive, step.seconds)

    def _within_range(self, sample: JointSample) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Desired angles and velocities, cut where the tube at hand lets the tip bend no more."""
        angle, velocity = keep_within(self._ranges(), sample.position, sample.velocity)
        if angle != sample.position:
            self._beyond_range += 1
        return angle, velocity

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

    def _correction(self, stamp_ns: int) -> np.ndarray | None:
        """Newest correction from before this command: which one must not depend on chance."""
        # This mode learns from the tracker itself.
        if self._feedforward.law.mode == ADAPTIVE_PHYSICAL:
            return None
        for sample in reversed(self._corrections):
            if sample is not None and sample.stamp_ns < stamp_ns:
                fresh = (stamp_ns - sample.stamp_ns) <= self.rig.timeouts.command_ns
                return np.array(sample.position) if fresh else None
        return None

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
        law = self._feedforward.law
        values: dict[str, object] = {
            'mode': law.mode,
            'wanted_mode': self._settings.mode,
            'selected_by': self._settings.selected_by,
            'lead': self._settings.lead,
            'gear': self.rig.joints.gear,
        }
        if self.findings is not None and self.findings.class_deg is not None:
            values['class_deg'] = self.findings.class_deg
        for joint, parameters in zip(names.JOINTS, law.parameters, strict=False):
            values |= {f'{joint}.{key}': value for key, value in parameters.to_dict().items()}
        said = status('compensator: model', OK, self._model_in_words(), values)
        self._states.publish(diagnostic_array(now, said))

    def _model_in_words(self) -> str:
        if self._settings.mode == 'none':
            return 'no feed-forward'
        if self._trouble:
            return f'no feed-forward: {self._trouble}'
        if self._settings.selected_by == BY_ADOPTED and self._adoption.plant is not None:
            return f'{self._settings.mode} by adopted: plant {self._adoption.plant.hash}'
        if self.findings is None:
            return (
                f'no feed-forward: {self._settings.mode} waits for a calibration; '
                f'{self.operate("calibrate")}'
            )
        return f'{self._settings.mode} by {self._settings.selected_by}: {_in_words(self.findings)}'

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
        return (
            level,
            said,
            {
                'cut to the reach': self._beyond_range,
                'source': self._source,
                'published': self._motors.count,
                'corrected': self._corrected,
                'bounded': self.shaper.bounded,
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
