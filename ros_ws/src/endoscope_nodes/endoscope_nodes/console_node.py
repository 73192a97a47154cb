"""The operator's side: plays a motion, or follows the handle while the clutch is held."""

from dataclasses import dataclass
from pathlib import Path

from sensor_msgs.msg import Joy

from endoscope_core.safety import ClutchFollower
from endoscope_core.signals import MOTIONS
from endoscope_core.signals.command_file import CommandFileError
from endoscope_nodes.clutch_watch import ClutchWatch
from endoscope_nodes.console_motion import (
    SampledMotion,
    load_command_file,
    sample_motion,
)
from endoscope_nodes.diagnostics import OK, WARN, Report
from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.joint_stream import JointPublisher, JointSample, JointSubscription
from endoscope_nodes.names import JOINTS, MASTER_CLUTCH, MASTER_MEASURED, SLAVE_COMMAND
from endoscope_nodes.parameters import ParameterError, parameter
from endoscope_nodes.qos import COMMAND, EVENT, SENSOR_ASKED
from endoscope_nodes.runtime import Runtime, run_nodes
from endoscope_nodes.state_watch import StateWatch
from endoscope_nodes.ticker import TICK_NS

HANDLE_TIMEOUT_NS = 100_000_000


@dataclass(frozen=True)
class ConsoleParameters:
    """Parameters of the console."""

    source: str = parameter(
        'none',
        'where commands come from; setting it starts a motion or file anew',
        choices=('none', 'motion', 'file', 'master'),
        dynamic=True,
    )
    motion: str = parameter(
        'periodic', 'motion that is played', choices=tuple(MOTIONS), dynamic=True
    )
    joints: tuple[str, ...] = parameter(
        JOINTS, 'joints that the motion moves', choices=JOINTS, dynamic=True
    )
    command_file: str = parameter(
        '', 'CSV file that is played, columns time [s], bend_x and bend_y [rad]', dynamic=True
    )
    scale: float = parameter(
        1.0, 'slave motion for one radian of handle motion', low=0.01, high=10.0, dynamic=True
    )
    approach_speed: float = parameter(
        1.0,
        'largest speed on the way to the first angle of a motion',
        unit='rad/s',
        low=0.01,
        high=10.0,
    )
    joint_limit: float = parameter(
        1.75,
        'bending at which following the handle ends, either way',
        unit='rad',
        low=0.1,
        high=3.1,
    )


class ConsoleNode(EndoscopeNode):
    """Publishes ``slave/servo_jp`` at 1 kHz, and ``master/clutch`` while it plays.

    A motion runs while the slave is enabled, stands still while it is not, and is held at its end.
    Following, commands go out only while the clutch is held and both clutch and handle are alive;
    each engagement begins where the last command was.
    """

    def __init__(self, runtime: Runtime) -> None:
        super().__init__('console', runtime)
        self._command = [0.0] * (2 * len(JOINTS))
        self._played: SampledMotion | None = None
        self._next = 0
        self._clutch_said = False
        self._handle: JointSample | None = None
        self._handle_ns = -HANDLE_TIMEOUT_NS
        self._settings = self.parameters(ConsoleParameters, self._on_parameters, self._load)
        limits = (self._settings.joint_limit,) * len(JOINTS)
        self._follower = ClutchFollower(self._settings.scale, [-limit for limit in limits], limits)
        self._commands = JointPublisher(
            self, SLAVE_COMMAND, JOINTS, ('position', 'velocity'), COMMAND
        )
        self._clutch_out = self.create_publisher(Joy, MASTER_CLUTCH, EVENT)
        self._state = StateWatch(self, self.ticker)
        JointSubscription(self, MASTER_MEASURED, JOINTS, self._on_handle, SENSOR_ASKED)
        self._clutch = ClutchWatch(self, self.ticker)
        self._on_parameters(self._settings)
        self.diagnostics.add('commands', self._report)
        self.ticker.every(0.1, self._repeat_clutch)
        self.ticker.add(self._on_tick)

    @property
    def finished(self) -> bool:
        """Whether the motion or file has been played to its end."""
        return self._played is not None and self._next >= len(self._played)

    def _load(self, parameters: ConsoleParameters) -> SampledMotion | None:
        here = tuple(self._command[: len(JOINTS)])
        tick = TICK_NS * 1e-9
        if parameters.source == 'motion':
            return sample_motion(
                parameters.motion, parameters.joints, here, tick, parameters.approach_speed
            )
        if parameters.source == 'file':
            try:
                return load_command_file(
                    Path(parameters.command_file), here, tick, parameters.approach_speed
                )
            except CommandFileError as error:
                raise ParameterError(f"console: parameter 'command_file': {error}") from error
        return None

    def _on_parameters(self, parameters: ConsoleParameters) -> None:
        self._settings = parameters
        self._next = 0
        self._played = self._load(parameters)

    def _on_handle(self, sample: JointSample) -> None:
        if sample.position:
            self._handle = sample
            self._handle_ns = self.ticker.monotonic_ns()

    @property
    def _playing(self) -> bool:
        return self._played is not None and self._state.enabled

    def _repeat_clutch(self) -> None:
        if self._played is not None and self.ticker.now_ns():
            self._publish_clutch(self.ticker.now_ns())

    def _publish_clutch(self, stamp_ns: int) -> None:
        self._clutch_said = self._playing
        message = Joy(buttons=[int(self._clutch_said)])
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
        self._clutch_out.publish(message)

    def _on_tick(self, stamp_ns: int, periods: int) -> None:
        if self._playing != self._clutch_said:
            self._publish_clutch(stamp_ns)
        if self._played is not None:
            if self._state.enabled:
                self._command = self._played.row(self._next)
                self._next += periods
            else:
                self._command = [*self._command[: len(JOINTS)], *(0.0,) * len(JOINTS)]
            self._commands.publish(stamp_ns, *self._command)
        elif self._settings.source == 'master':
            self._follow(stamp_ns, periods)

    def _follow(self, stamp_ns: int, periods: int) -> None:
        now = self.ticker.monotonic_ns()
        held = self._clutch.held
        alive = self._handle is not None and now - self._handle_ns <= HANDLE_TIMEOUT_NS
        if not (held and alive and self._state.enabled) or self._handle is None:
            self._follower.release()
            return
        before = self._command[: len(JOINTS)]
        if not self._follower.engaged:
            self._follower.scale = self._settings.scale
            self._follower.engage(self._handle.position, before)
        position = self._follower.follow(self._handle.position)
        dt = periods * TICK_NS * 1e-9
        self._command = [*position, *((p - b) / dt for p, b in zip(position, before, strict=True))]
        self._commands.publish(stamp_ns, *self._command)

    def _report(self) -> Report:
        source = self._settings.source
        values: dict[str, object] = {
            'source': source,
            'published': self._commands.count,
            'clutch held': self._clutch.held,
            'following': self._follower.engaged,
        }
        if self._played is not None:
            values['progress [s]'] = min(self._next, len(self._played)) * 1e-3
            values['length [s]'] = len(self._played) * 1e-3
            return OK, 'finished' if self.finished else 'playing', values
        if source == 'master' and self._handle is None:
            return WARN, f'{MASTER_MEASURED} has not been received', values
        return OK, source, values


def main() -> int:
    """Run the console in a process of its own."""
    return run_nodes([ConsoleNode])
