"""The operator's side: plays a motion, or follows a handle or velocities by the clutch."""

from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.publisher import Publisher
from sensor_msgs.msg import Joy

from endoscope_core.choices import FOLLOW_THE_HANDLE
from endoscope_core.control import HandleRefusal
from endoscope_core.control.master_motion import CommandedVelocity, MasterMotion, PlayedMotion
from endoscope_core.control.velocity_stream import WATCHDOG_NS
from endoscope_core.errors import FileError
from endoscope_core.signals.sampled_motion import SampledMotion, load_command_file, sample_motion
from endoscope_nodes import names
from endoscope_nodes.client.calibration_result import findings_of, is_of_no_class
from endoscope_nodes.client.handle_sender import CLUTCH_PERIOD_NS, clutch_message
from endoscope_nodes.client.plant_adoption import PlantInForce
from endoscope_nodes.runtime.diagnostics import OK, WARN, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import MasterParameters
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import COMMAND, EVENT, SENSOR_ASKED
from endoscope_nodes.runtime.streams import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.runtime.ticker import TICK_S
from endoscope_nodes.safety.sessions import TURN_S, ClutchWatch, SessionWatch
from endoscope_nodes.safety.streams import StreamWatch
from endoscope_nodes.safety.velocities import VelocityCommands

WAITING = 'goes on while the clutch is held'
"""Message of the diagnostics while a motion waits for the operator's hand."""


class MasterNode(EndoscopeNode):
    """Publishes ``slave/servo_jp`` at 1 kHz, and ``master/clutch`` while it plays.

    It moves the slave only in a motion session, every time from the measured pose (see
    :class:`MasterMotion`), and rests during a calibration. With source ``none`` it makes commands
    of another program's velocities; with ``hold_to_play`` that has the clutch.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(names.MASTER_NODE, context)
        self._clutch_said = self._warned = False
        self._refused_before = self._handle_ns = self._clutch_said_ns = 0
        self._settings = self.parameters(MasterParameters, self._on_parameters, _load)
        self._commands: JointPublisher | None = None
        self._clutch_out: Publisher | None = None
        self._session = SessionWatch(self, self._rest, self._rest)
        self._pose = context.pose_of(self)
        self.motion = MasterMotion(self.rig, self._pose.bending)
        self._calibration = StreamWatch.of(self, names.CALIBRATION_COMMAND, COMMAND)
        handle = self.motion.handle
        self._session.one_sender(
            lambda receive: (
                JointSubscription(
                    self,
                    names.MASTER_MEASURED,
                    names.JOINTS,
                    receive,
                    SENSOR_ASKED,
                    on_malformed=lambda reason: handle.refuse(HandleRefusal.MALFORMED, reason),
                ).subscription
            ),
            self._on_handle,
        )
        self._clutch = ClutchWatch(self, self._session)
        self._velocities = VelocityCommands(
            self,
            self._session,
            self.motion.velocities,
            lambda: self._clutch.held,
            lambda: self.motion.where,
            self._other_source,
        )
        self._session.results(names.CALIBRATION_RESULT, self._on_result)
        self._session.results(names.COMPENSATOR_PLANT, self._on_plant)
        self._on_parameters(self._settings)
        self.diagnostics.add('commands', self._report)
        self.ticker.every(TURN_S, self._find_velocities)
        self.ticker.add(self._on_tick)

    def _on_parameters(self, parameters: MasterParameters) -> None:
        self._rest()
        self._settings, self._warned = parameters, False
        played = _load(parameters)
        if played is not None:
            self.motion.play(played, parameters.approach_speed, parameters.hold_to_play)
        elif parameters.source == FOLLOW_THE_HANDLE:
            self.motion.follow(parameters.scale)
        else:
            self.motion.leave()
        self._own_topics()

    def _own_topics(self) -> None:
        """Be a sender only of what the source asks for: another one may be the sender then."""
        source = self.motion.source
        if self._commands is None and source is not None:
            self._commands = JointPublisher(
                self, names.SLAVE_COMMAND, names.JOINTS, ('position', 'velocity'), COMMAND
            )
            self._commands.session = self._session.name
        elif self._commands is not None and source is None:
            self._commands.close()
            self._commands = None
        speaks = isinstance(source, PlayedMotion) and not source.hold
        if self._clutch_out is None and speaks:
            self._clutch_out = self.create_publisher(Joy, names.MASTER_CLUTCH, EVENT)
        elif self._clutch_out is not None and not speaks:
            self.destroy_publisher(self._clutch_out)
            self._clutch_out = None

    def _other_source(self) -> str:
        source = self._settings.source
        return (
            '' if source == 'none' else f"velocities are sent while the master's source is {source}"
        )

    def _find_velocities(self) -> None:
        """Obey velocities while they have a sender; one that goes is left by the watchdog first."""
        obeys = isinstance(self.motion.source, CommandedVelocity)
        if self._settings.source == 'none' and not self.motion.moving:
            alone = self._velocities.alone
            if alone != obeys:
                (self.motion.obey_velocities if alone else self.motion.leave)()
                self._own_topics()

    def _on_handle(self, sample: JointSample) -> None:
        self._handle_ns = self.ticker.hand_ns()
        self.motion.take_handle(sample.stamp_ns, sample.position, self.ticker.monotonic_ns())

    def _on_result(self, message: DiagnosticArray) -> None:
        """Keep to what this session's own calibration found out about the tube's range."""
        if self._session.belongs(message.header.frame_id):
            found = findings_of(message)
            if found is not None or is_of_no_class(message):
                self.motion.ranges = () if found is None else found.ranges

    def _on_plant(self, message: DiagnosticArray) -> None:
        """Keep to how far the plant that has been adopted in this session lets the tip be bent."""
        plant = PlantInForce.of_message(message)
        if plant is None:
            self.get_logger().warning(f'{names.COMPENSATOR_PLANT} cannot be read: ignored')
        elif self._session.belongs(message.header.frame_id):
            self.motion.ranges = plant.ranges

    def _rest(self) -> None:
        self.motion.rest()
        if self._commands is not None:
            self._commands.session = self._session.name
        if self._clutch_said:
            self._publish_clutch(self.ticker.now_ns())

    def _publish_clutch(self, stamp_ns: int) -> None:
        if self._clutch_out is not None:
            self._clutch_said, self._clutch_said_ns = self.motion.moving, self.ticker.hand_ns()
            self._clutch_out.publish(clutch_message(self._clutch_said, stamp_ns))

    def _on_tick(self, stamp_ns: int, periods: int) -> None:
        self._session.turn()
        now, timeouts = self.ticker.hand_ns(), self.rig.timeouts
        if now - self._handle_ns > timeouts.handle_ns:
            self.motion.handle.lose()
        if now - self._velocities.heard_ns > WATCHDOG_NS:
            self.motion.velocities.lose()
        desired = self.motion.next(
            self.ticker.monotonic_of(stamp_ns),
            self.ticker.monotonic_ns(),
            periods,
            held=self._clutch.held,
            free=bool(self._session.name) and not self._calibration.heard(timeouts.command_ns),
        )
        moved = self.motion.moving != self._clutch_said
        if moved or now - self._clutch_said_ns >= CLUTCH_PERIOD_NS:
            self._publish_clutch(stamp_ns)
        if desired is not None and self._commands is not None:
            self._commands.publish(stamp_ns, *desired.position, *desired.velocity)
        if self.motion.velocities_ended(self.ticker.monotonic_ns()):
            last = self.motion.velocities.gate.last_reason
            refused = f' ({last})' if last else ''
            self._session.leave(
                f'{self._velocities.topic} ended while the clutch was held{refused}'
            )

    def _unheeded(self) -> str:
        """Say that a handle is not followed, if somebody moves it or holds its clutch."""
        moves, source = self.motion.handle_moved(), self._settings.source
        # A program that commands the slave itself holds the clutch with reason.
        held = (
            self._clutch.held
            and self.motion.handle.alive(self.ticker.monotonic_ns())
            and not self.count_publishers(names.SLAVE_COMMAND)
        )
        if source == FOLLOW_THE_HANDLE or not (moves or held):
            return ''
        return (
            f'the handle {"moves" if moves else "has its clutch held"} and nothing follows it: '
            f"the master's source is {source}; "
            + self.operate(f'set {names.MASTER_NODE}.source {FOLLOW_THE_HANDLE}')
        )

    def _report(self) -> Report:
        settings, motion, handle = self._settings, self.motion, self.motion.handle
        played = motion.source if isinstance(motion.source, PlayedMotion) else None
        finished = played is not None and played.finished
        values: dict[str, object] = {
            'source': settings.source,
            'published': self._commands.count if self._commands is not None else 0,
            'clutch held': self._clutch.held,
            'following': handle.engaged,
            'lag [s]': handle.lag,
            names.FINISHED: finished,
        }
        values |= {f'handle refused: {reason}': n for reason, n in handle.refused.items()}
        refused = sum(handle.refused.values())
        fresh, self._refused_before = refused - self._refused_before, refused
        if fresh:
            text = f'{fresh} messages of {names.MASTER_MEASURED} refused'
            return WARN, f'{text}, last: {handle.last_reason}', values
        unheeded = self._unheeded()
        if unheeded and not self._warned:
            self._warned = True
            self.get_logger().warning(unheeded)
        cut = '' if unheeded else motion.cut.report()
        if unheeded or cut:
            return WARN, unheeded or cut, values
        if played is not None:
            values |= {'progress [s]': played.progress, 'length [s]': played.length}
            waits = not played.follows(self._clutch.held)
            return OK, names.FINISHED if finished else WAITING if waits else 'playing', values
        if settings.source == FOLLOW_THE_HANDLE and not handle.alive(self.ticker.monotonic_ns()):
            return WARN, f'{names.MASTER_MEASURED} is silent', values
        return OK, settings.source, values


def _load(parameters: MasterParameters) -> SampledMotion | None:
    if parameters.source == 'motion':
        return sample_motion(parameters.motion, parameters.joints, TICK_S)
    if parameters.source == 'file':
        try:
            return load_command_file(Path(parameters.command_file), TICK_S)
        except FileError as error:
            raise ParameterError(
                f"{names.MASTER_NODE}: parameter 'command_file': {error}"
            ) from error
    return None
