"""Turns desired bending into motor commands that make up for the hysteresis."""

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter
from rclpy.subscription import Subscription

from endoscope_core.compensation.command_stream import Command, CommandStream, Measured
from endoscope_core.compensation.law_in_force import LawInForce, Selection
from endoscope_core.control import AdoptedPlant, Feedforward, FeedforwardSettings, MotorLimits
from endoscope_core.identification.law_choice import LawChoice
from endoscope_core.safety import FeltForce, GuardState
from endoscope_nodes import names
from endoscope_nodes.client.calibration_result import findings_of, is_of_no_class
from endoscope_nodes.nodes.plant_adoption import PlantAdoption
from endoscope_nodes.runtime.diagnostics import ERROR, OK, WARN, Report, diagnostic_array, status
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import FOR_SESSION, CompensatorParameters
from endoscope_nodes.runtime.qos import COMMAND, RESULT, SENSOR_ASKED
from endoscope_nodes.runtime.streams import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.safety.sessions import TURN_S, ClutchWatch, SessionWatch
from endoscope_nodes.safety.streams import CommandReport


class CompensatorNode(EndoscopeNode):
    """The only publisher of ``motor/servo_jp``.

    It obeys commands and corrections of the motion session that it takes part in, each from one
    sender; see :class:`CommandStream` and :class:`LawInForce`.  A master that falls silent while
    the clutch is held ends the session.  What pushes at the tip, by ``tip_force/bounds``, is
    approached slowly; see :class:`ContactGuard`.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('compensator', context)
        p = self._settings = self.parameters(CompensatorParameters, self._on_parameters)
        limits, joints = MotorLimits.of(self.rig), len(names.JOINTS)
        settings = FeedforwardSettings(limits, lead=p.lead, speed_limit=limits.speed / limits.gear)
        self.law = LawInForce(
            Feedforward(joints, settings),
            LawChoice(joints, p.parameter_sets, p.table),
            Selection(p.mode, p.selected_by),
        )
        self.stream, self._calibrated_in = CommandStream(self.rig, self.law), ''
        stream = self.stream
        self._motors = JointPublisher(
            self, names.MOTOR_COMMAND, names.MOTORS, ('position',), COMMAND
        )
        self._states = self.create_publisher(DiagnosticArray, names.COMPENSATOR_STATE, RESULT)
        self._session = SessionWatch(self, self._restart, self._restart)
        self._clutch = ClutchWatch(self, self._session, stream.end_master)
        self._pose = context.pose_of(self)
        commands = self._session.commands
        commands(
            names.CALIBRATION_COMMAND, stream.calibration_gate, self._on_calibration, obeys=True
        )
        commands(names.SLAVE_COMMAND, stream.gate, self._on_master, obeys=True)
        commands(names.CORRECTION, stream.correction_gate, self._on_correction)
        self._session.results(names.CALIBRATION_RESULT, self._on_result, self._doubt_results)
        self._session.one_sender(self._bounds, self._on_bounds)
        self._guard_reported: tuple[object, ...] = ()
        self._guard_since_ns = 0
        self._adoption = PlantAdoption(
            self, self._session, self.law, self._check_rest, self._reselect
        )
        add = self.diagnostics.add
        add('commands', CommandReport(stream.gate, self.ticker, self._session.leave))
        add('calibration commands', CommandReport(stream.calibration_gate, self.ticker))
        add('corrections', CommandReport(stream.correction_gate, self.ticker))
        add('output', self._report)
        add('guard', self._report_guard)
        self.ticker.every(TURN_S, self._watch_motion)
        self.ticker.every(0.1, self._publish_state)

    def _on_parameters(self, parameters: CompensatorParameters) -> None:
        if self._settings.for_session and not parameters.for_session:
            self.law.end_session()
        self._settings = parameters
        self.law.select(Selection(parameters.mode, parameters.selected_by))
        self._adoption.publish()

    def _reselect(self, selection: Selection) -> None:
        wanted: dict[str, str | bool] = dict(selection._asdict())
        if self._settings.for_session:
            wanted |= {FOR_SESSION: True}
        self.set_parameters_atomically([Parameter(k, value=v) for k, v in wanted.items()])
        # Another plant may be in force under the same selection.
        self.law.select(Selection(self._settings.mode, self._settings.selected_by))

    def _restart(self) -> None:
        self.stream.restart()
        self._motors.session = self._session.name

    @property
    def _measured(self) -> Measured:
        pose = self._pose
        tracked = None if pose.tracked is None else (pose.tracked.stamp_ns, pose.tracked.position)
        return Measured(pose.bending(), pose.shafts(), pose.shafts_ns, tracked)

    def _check_rest(self, plant: AdoptedPlant | None) -> None:
        self.stream.check_rest(self.ticker.monotonic_ns(), self._measured, plant)

    def _on_master(self, sample: JointSample) -> None:
        now, held = self.ticker.monotonic_ns(), self._clutch.held
        self._put_out(sample, self.stream.follow(_command(sample), now, self._measured, held))

    def _on_calibration(self, sample: JointSample) -> None:
        now = self.ticker.monotonic_ns()
        if self._put_out(sample, self.stream.calibrate(_command(sample), now, self._measured)):
            self._calibrated_in = self._session.name

    def _on_correction(self, sample: JointSample) -> None:
        self.stream.correct(_command(sample), self.ticker.monotonic_ns())

    def _bounds(self, receive: Callable[[JointSample], None]) -> Subscription:
        topic, asked = names.TIP_FORCE_BOUNDS, SENSOR_ASKED
        stream = JointSubscription(self, topic, names.BOUNDS, receive, asked, exact=True)
        return stream.subscription

    def _on_bounds(self, sample: JointSample) -> None:
        if not sample.effort:
            return
        x, y, low_x, low_y, high_x, high_y, _ = sample.effort
        age_ns = max(0, self.ticker.now_ns() - sample.stamp_ns)
        felt_ns = self.ticker.monotonic_ns() - age_ns
        felt = FeltForce(felt_ns, (x, y), (low_x, low_y), (high_x, high_y))
        self.stream.contact.feel(felt)
        self._look_at_guard()

    def _look_at_guard(self) -> None:
        """Report at once how the guard's state has changed, if it has."""
        guard = self.stream.contact
        yields = guard.state is GuardState.YIELDING
        state = (guard.state, guard.reason, guard.joints if yields else ())
        if state != self._guard_reported:
            self._guard_reported, self._guard_since_ns = state, self.ticker.now_ns()
            self.diagnostics.publish()

    def _report_guard(self) -> Report:
        guard = self.stream.contact
        values: dict[str, object] = {
            'state': guard.state,
            'limit [N]': guard.limit,
            'joints': ' '.join(guard.joints),
            'since': f'{self._guard_since_ns * 1e-9:.3f}',
        }
        level = WARN if guard.state is GuardState.YIELDING else OK
        return level, guard.in_words(), values

    def _put_out(self, sample: JointSample, shafts: tuple[float, ...]) -> bool:
        if shafts:
            self._motors.publish(sample.stamp_ns, *shafts)
        return bool(shafts)

    def _watch_motion(self) -> None:
        now, held = self.ticker.monotonic_ns(), self._clutch.held
        reason = self.stream.watch(now, self._measured, held)
        self._look_at_guard()
        if reason:
            self._session.leave(reason)

    def _on_result(self, message: DiagnosticArray) -> None:
        found = findings_of(message)
        if found is None and not is_of_no_class(message):
            return
        session = message.header.frame_id
        if self._calibrated_in and session == self._calibrated_in:
            self.law.pending = (found,)
        else:
            why = f'it is of {session or "no session"}'
            self.get_logger().warning(f'{names.CALIBRATION_RESULT} is not taken: {why}')

    def _doubt_results(self, competing: str) -> None:
        """Take no result before another calibration: it may be somebody else's."""
        self._calibrated_in = ''
        self.get_logger().warning(f'{names.CALIBRATION_RESULT} is not taken: {competing}')
        self._session.leave(competing)

    def _publish_state(self) -> None:
        now, law = self.ticker.now_ns(), self.law
        if now and law.changed:
            law.changed = False
            values = law.figures(self._settings.lead, self.rig.joints.gear)
            model = status(
                'compensator: model', OK, law.in_words(self.operate('calibrate')), values
            )
            self._states.publish(diagnostic_array(now, model))

    def close(self) -> None:
        """Let the thread end in which plants are tried."""
        self._adoption.close()

    def _report(self) -> Report:
        law, stream = self.law, self.stream
        waiting = self._settings.mode != 'none' and not law.is_known
        level = ERROR if law.error else WARN if waiting else OK
        words = law.in_words(self.operate('calibrate'))
        cut = stream.cut.report()
        if cut:
            level, words = max(level, WARN), f'{words}; {cut}'
        learnt = (f'{each.joint.capstan_exponent:.3f}' for each in law.feedforward.learnt)
        values: dict[str, object] = {
            'cut to the reach': stream.cut.count,
            'source': stream.source,
            'published': self._motors.count,
            'corrected': stream.corrected,
            'bounded': stream.shaper.bounded,
            'learnt': ' '.join(learnt),
        }
        return level, words, values


def _command(sample: JointSample) -> Command:
    return Command(sample.stamp_ns, sample.position, sample.velocity)
