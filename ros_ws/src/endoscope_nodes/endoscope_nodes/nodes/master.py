"""The operator's side: plays a motion, or follows the handle while the clutch is held."""

import operator
from collections.abc import Sequence
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.publisher import Publisher
from sensor_msgs.msg import Joy

from endoscope_core.choices import FOLLOW_THE_HANDLE
from endoscope_core.control import Handle, HandleRefusal, HandleSettings
from endoscope_core.errors import FileError
from endoscope_core.safety import (
    BendingRange,
    MotionLimits,
    MotionShaper,
    keep_within,
    ranges_in_words,
)
from endoscope_core.safety.motion_session import STALL_NS
from endoscope_nodes import names
from endoscope_nodes.client.calibration_result import findings_of, is_of_no_class
from endoscope_nodes.client.handle_sender import CLUTCH_PERIOD_NS, clutch_message
from endoscope_nodes.client.plant_adoption import PlantInForce
from endoscope_nodes.nodes.played_motion import (
    SampledMotion,
    approach,
    load_command_file,
    sample_motion,
)
from endoscope_nodes.runtime.diagnostics import OK, WARN, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import MasterParameters
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import COMMAND, EVENT, RESULT, SENSOR_ASKED
from endoscope_nodes.runtime.streams import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.runtime.ticker import TICK_S
from endoscope_nodes.safety.sessions import ClutchWatch, SessionWatch
from endoscope_nodes.safety.streams import StreamWatch

# A hand that rests on a handle moves it by less than half a degree.
_MOTION_RAD = 0.01

WAITING = 'goes on while the clutch is held'
"""Message of the diagnostics while a motion waits for the operator's hand."""


class MasterNode(EndoscopeNode):
    """Publishes ``slave/servo_jp`` at 1 kHz, and ``master/clutch`` while it plays.

    It moves the slave only in a motion session, and every time from the measured pose: a motion is
    approached from there, goes on where it stood still, and is held at its end; a handle is
    followed from there whenever the clutch is engaged or the handle was silent. While a
    calibration or a way home has the slave, the master rests. With source ``none`` it leaves both
    topics to somebody else. With ``hold_to_play`` it leaves him the clutch alone, and plays while
    that is held.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(names.MASTER_NODE, context)
        self._played: SampledMotion | None = None
        self._next = 0
        self._approach: SampledMotion | None = None
        self._approached = 0
        self._stay: tuple[float, ...] = ()
        self._moving = False
        self._sent_ns: int | None = None
        self._clutch_said = False
        self._refused_before = 0
        self._handle_ns = self._clutch_said_ns = 0
        self._handle_from: tuple[float, ...] = ()
        self._handle_moves = False
        self._told_of_handle = False
        self._ranges: tuple[BendingRange, ...] = ()
        self._beyond_range = self._beyond_before = 0
        facts = self.rig.joints
        limits, hand_limits = (
            MotionLimits.either_way(
                len(names.JOINTS), facts.reach, speed, facts.acceleration, facts.entry_step
            )
            for speed in (facts.speed, facts.hand_speed)
        )
        self._playing_shaper = MotionShaper(limits)
        self._hand_shaper = MotionShaper(hand_limits)
        self._settings = self.parameters(MasterParameters, self._on_parameters, self._load)
        self._handle = Handle(
            limits.low,
            limits.high,
            self._settings.scale,
            HandleSettings(self.rig.handle.resolution, timeout=self.rig.timeouts.handle),
        )
        self._commands: JointPublisher | None = None
        self._clutch_out: Publisher | None = None
        self._session = SessionWatch(self, self._rest, self._rest)
        self._pose = context.pose_of(self)
        self._calibration = StreamWatch.of(self, names.CALIBRATION_COMMAND, COMMAND)
        handle = JointSubscription(
            self,
            names.MASTER_MEASURED,
            names.JOINTS,
            self._on_handle,
            SENSOR_ASKED,
            on_malformed=lambda reason: self._handle.refuse(HandleRefusal.MALFORMED, reason),
        )
        self._handle_senders = self._session.senders_of(handle.subscription)
        self._clutch = ClutchWatch(self, self._session)
        results = self.create_subscription(
            DiagnosticArray, names.CALIBRATION_RESULT, self._on_result, RESULT
        )
        self._results = self._session.senders_of(results)
        plants = self.create_subscription(
            DiagnosticArray, names.COMPENSATOR_PLANT, self._on_plant, RESULT
        )
        self._plants = self._session.senders_of(plants)
        self._on_parameters(self._settings)
        self.diagnostics.add('commands', self._report)
        self.ticker.add(self._on_tick)

    @property
    def finished(self) -> bool:
        """Whether the motion or file has been played to its end."""
        return self._played is not None and self._next >= len(self._played)

    def _load(self, parameters: MasterParameters) -> SampledMotion | None:
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

    def _on_parameters(self, parameters: MasterParameters) -> None:
        self._settings = parameters
        self._rest()
        self._next = 0
        self._handle_moves = self._told_of_handle = False
        self._played = self._load(parameters)
        self._own_topics()

    def _own_topics(self) -> None:
        """Be a sender only of what the source asks for: another one may be the sender then."""
        if self._commands is None and self._settings.source != 'none':
            self._commands = JointPublisher(
                self, names.SLAVE_COMMAND, names.JOINTS, ('position', 'velocity'), COMMAND
            )
            self._commands.session = self._session.name
        elif self._commands is not None and self._settings.source == 'none':
            self._commands.close()
            self._commands = None
        speaks = self._played is not None and not self._settings.hold_to_play
        if self._clutch_out is None and speaks:
            self._clutch_out = self.create_publisher(Joy, names.MASTER_CLUTCH, EVENT)
        elif self._clutch_out is not None and not speaks:
            self.destroy_publisher(self._clutch_out)
            self._clutch_out = None

    def _on_handle(self, sample: JointSample) -> None:
        rivals = self._handle_senders.rivals()
        if rivals:
            self._session.leave(rivals)
            return
        self._handle_ns = self.ticker.hand_ns()
        refused = self._handle.take(sample.stamp_ns, sample.position, self.ticker.monotonic_ns())
        if refused is None and self._settings.source != FOLLOW_THE_HANDLE:
            self._notice_motion(sample.position)

    def _notice_motion(self, position: tuple[float, ...]) -> None:
        """Notice that somebody moves a handle that nothing follows."""
        if len(self._handle_from) != len(position):
            self._handle_from = position
        moved = max(map(abs, map(operator.sub, position, self._handle_from)), default=0.0)
        if moved > _MOTION_RAD:
            self._handle_from, self._handle_moves = position, True

    def _unheeded(self) -> str:
        """Say that a handle is not followed, if somebody moves it or holds its clutch."""
        moves, self._handle_moves = self._handle_moves, False
        # A program that commands the slave itself holds the clutch with reason.
        held = (
            self._clutch.held
            and self._handle.alive(self.ticker.monotonic_ns())
            and not self.count_publishers(names.SLAVE_COMMAND)
        )
        source = self._settings.source
        if source == FOLLOW_THE_HANDLE or not (moves or held):
            return ''
        return (
            f'the handle {"moves" if moves else "has its clutch held"} and nothing follows it: '
            f"the master's source is {source}; "
            + self.operate(f'set {names.MASTER_NODE}.source {FOLLOW_THE_HANDLE}')
        )

    def _on_result(self, message: DiagnosticArray) -> None:
        """Keep to what this session's own calibration found out about the tube's range."""
        rivals = self._results.rivals()
        if rivals:
            self._session.leave(rivals)
        if not self._session.belongs(message.header.frame_id):
            return
        found = findings_of(message)
        if found is not None or is_of_no_class(message):
            self._ranges = () if found is None else found.ranges

    def _on_plant(self, message: DiagnosticArray) -> None:
        """Keep to how far the plant that has been adopted in this session lets the tip be bent."""
        rivals = self._plants.rivals()
        if rivals:
            self._session.leave(rivals)
            return
        plant = PlantInForce.of_message(message)
        if plant is None:
            self.get_logger().warning(f'{names.COMPENSATOR_PLANT} cannot be read: ignored')
        elif self._session.belongs(message.header.frame_id):
            self._ranges = plant.ranges

    def _rest(self) -> None:
        """Stop moving: whatever comes next begins at the measured pose."""
        self._moving = False
        self._handle.release()
        if self._commands is not None:
            self._commands.session = self._session.name
        if self._clutch_said:
            self._publish_clutch(self.ticker.now_ns())

    def _publish_clutch(self, stamp_ns: int) -> None:
        if self._clutch_out is None:
            return
        self._clutch_said, self._clutch_said_ns = self._moving, self.ticker.hand_ns()
        self._clutch_out.publish(clutch_message(self._clutch_said, stamp_ns))

    @property
    def _may_move(self) -> bool:
        return bool(self._session.name) and not self._calibration.heard(
            self.rig.timeouts.command_ns
        )

    @property
    def _waits_for_the_clutch(self) -> bool:
        return self._settings.hold_to_play and not self._clutch.held

    def _begin(self) -> bool:
        """Begin a stream, but not before the compensator knows that the last one has ended."""
        # The compensator would take it for the last one going on, and for a jump: the measured pose
        # is not what was commanded. It hears a command at most `STALL_NS` late, or leaves the
        # session.
        apart_ns = self.rig.timeouts.command_ns + STALL_NS
        now = self.ticker.monotonic_ns()
        soon = self._sent_ns is not None and now - self._sent_ns <= apart_ns
        self._moving = not soon
        return self._moving

    def _on_tick(self, stamp_ns: int, periods: int) -> None:
        self._session.turn()
        now = self.ticker.hand_ns()
        if now - self._clutch_said_ns >= CLUTCH_PERIOD_NS:
            self._publish_clutch(stamp_ns)
        if now - self._handle_ns > self.rig.timeouts.handle_ns:
            self._handle.lose()
        followed = self._handle.follow(self.ticker.monotonic_of(stamp_ns))
        if self._commands is None:
            return
        if not self._may_move:
            if self._moving:
                self._rest()
        elif self._played is not None:
            self._play(self._commands, self._played, stamp_ns, periods)
        else:
            self._follow(self._commands, followed, stamp_ns, periods)

    def _play(
        self, commands: JointPublisher, motion: SampledMotion, stamp_ns: int, periods: int
    ) -> None:
        if self._waits_for_the_clutch:
            if self._moving:
                self._rest()
            return
        if not self._moving:
            pose = self._pose.bending()
            if pose is None or not self._begin():
                return
            pose = self._stay = self.rig.joints.entry(pose)
            self._approach = approach(
                pose, motion.at(self._next, pose)[0], self._settings.approach_speed, TICK_S
            )
            self._approached = 0
            self._playing_shaper.restart(pose)
            self._publish_clutch(stamp_ns)
        if self._approach is not None and self._approached < len(self._approach):
            angle, velocity = self._approach.at(self._approached, self._stay)
            self._approached += periods
        else:
            angle, velocity = motion.at(self._next, self._stay)
            self._next += periods
        self._publish(commands, self._playing_shaper, angle, velocity, stamp_ns, periods)

    def _follow(
        self,
        commands: JointPublisher,
        followed: tuple[tuple[float, ...], tuple[float, ...]] | None,
        stamp_ns: int,
        periods: int,
    ) -> None:
        if not self._clutch.held:
            self._moving = False
            self._handle.release()
            return
        if followed is None and self._handle.alive(self.ticker.monotonic_ns()):
            # A handle that was silent while the slave was told to stay is taken up from there.
            if self._moving:
                pose = self._hand_shaper.position
            else:
                measured = self._pose.bending()
                if measured is None or not self._begin():
                    return
                pose = self.rig.joints.entry(measured)
            self._handle.scale = self._settings.scale
            self._handle.engage(pose)
            self._hand_shaper.restart(pose)
            followed = pose, (0.0,) * len(names.JOINTS)
        if not self._moving:
            return
        # While the handle is silent and the clutch still held, the slave is told to stay.
        target, velocity = followed or (self._hand_shaper.position, (0.0,) * len(names.JOINTS))
        self._publish(commands, self._hand_shaper, target, velocity, stamp_ns, periods)

    def _publish(
        self,
        commands: JointPublisher,
        shaper: MotionShaper,
        angle: Sequence[float],
        velocity: Sequence[float],
        stamp_ns: int,
        periods: int,
    ) -> None:
        asked, (angle, velocity) = angle, keep_within(self._ranges, angle, velocity)
        self._beyond_range += angle != tuple(asked)
        shaped = shaper.shape(angle, periods * TICK_S)
        as_asked = all(abs(a - b) < 1e-9 for a, b in zip(angle, shaped, strict=True))
        self._sent_ns = self.ticker.monotonic_ns()
        commands.publish(stamp_ns, *shaped, *(velocity if as_asked else shaper.velocity))

    def _report(self) -> Report:
        source, handle = self._settings.source, self._handle
        values: dict[str, object] = {
            'source': source,
            'published': self._commands.count if self._commands is not None else 0,
            'clutch held': self._clutch.held,
            'following': handle.engaged,
            'lag [s]': handle.lag,
            names.FINISHED: self.finished,
        }
        values |= {f'handle refused: {reason}': n for reason, n in handle.refused.items()}
        refused = sum(handle.refused.values())
        fresh, self._refused_before = refused - self._refused_before, refused
        if fresh:
            said = (
                f'{fresh} messages of {names.MASTER_MEASURED} refused, last: {handle.last_reason}'
            )
            return WARN, said, values
        unheeded = self._unheeded()
        if unheeded and not self._told_of_handle:
            self._told_of_handle = True
            self.get_logger().warning(unheeded)
        if unheeded:
            return WARN, unheeded, values
        beyond = self._beyond_range - self._beyond_before
        self._beyond_before = self._beyond_range
        if beyond:
            return (
                WARN,
                f'{ranges_in_words(self._ranges, names.JOINTS)}, more was asked for',
                values,
            )
        if self._played is not None:
            values['progress [s]'] = min(self._next, len(self._played)) * TICK_S
            values['length [s]'] = len(self._played) * TICK_S
            if self.finished:
                return OK, names.FINISHED, values
            return OK, WAITING if self._waits_for_the_clutch else 'playing', values
        if source == FOLLOW_THE_HANDLE and not handle.alive(self.ticker.monotonic_ns()):
            return WARN, f'{names.MASTER_MEASURED} is silent', values
        return OK, source, values
