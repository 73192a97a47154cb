"""The slave moved by the keyboard: keys in, handle, clutch and messages out."""

import argparse
import math
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from sensor_msgs.msg import JointState

from endoscope_bags.errors import MalformedMessageError
from endoscope_bringup.teleop.keyboard_handle import KeyboardHandle, Request, Turn
from endoscope_bringup.teleop.terminal import Terminal, TerminalLostError
from endoscope_core.calibration.calibration_run import HOME, OrderState
from endoscope_core.choices import FOLLOW_THE_HANDLE, PLAYS
from endoscope_core.errors import printable
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import MASTER, GraphError
from endoscope_nodes.client.graph_parameters import read_parameter, set_parameters
from endoscope_nodes.client.handle_sender import HandleSender, handle_senders
from endoscope_nodes.names import (
    JOINTS,
    MASTER_CLUTCH,
    MASTER_MEASURED,
    MASTER_NODE,
    MOTOR_COMMAND,
    MOTORS,
    SLAVE_COMMAND,
    SLAVE_MEASURED,
)
from endoscope_nodes.runtime.qos import COMMAND
from endoscope_nodes.runtime.streams import JointReader

_TURN_NS = 10_000_000
_SHOWN_NS = 100_000_000
_FRESH_NS = 150_000_000
_SUPERVISED_NS = 1_000_000_000
_GONE_S = 5.0
_SETTLED_S = 0.2
_STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGTSTP)


def teleoperate(client: GraphClient, args: argparse.Namespace) -> int:
    """Move the slave by the terminal's keys until the operator has enough; the exit status."""
    client.find(args.timeout)
    source = read_parameter(client, f'{MASTER_NODE}.source', args.timeout).value
    scale = read_parameter(client, f'{MASTER_NODE}.scale', args.timeout).value
    _check_consent(source, args.take)
    with ExitStack() as stack:
        signals = stack.enter_context(_signals_noted())
        terminal = Terminal()
        before: dict[str, str | float] = {}
        stack.callback(_give_back, client, terminal, before, args.timeout)
        asked: dict[str, str | float] = {}
        if source != FOLLOW_THE_HANDLE:
            asked['source'], before['source'] = FOLLOW_THE_HANDLE, source
        if args.scale is not None:
            asked['scale'], before['scale'] = args.scale, scale
        if asked:
            set_parameters(client, MASTER_NODE, asked, args.timeout)
        _wait_for_the_handles_place(client)
        sender = HandleSender(client.node)
        stack.callback(sender.close)
        speed = math.radians(args.speed)
        scale = args.scale or scale
        teleoperation = _Teleoperation(client, terminal, sender, signals, speed, scale)
        stack.enter_context(terminal)
        return teleoperation.run()


def _check_consent(source: str, taken: bool) -> None:
    if source == FOLLOW_THE_HANDLE or taken:
        return
    plays = '; what it plays ends' if source in PLAYS else ''
    print(f'master.source is {source}: the master follows no handle.')
    try:
        answer = input(f'Set it to master until teleop ends{plays}? [y/N] ')
    except EOFError:
        answer = ''
    if answer.strip().lower() not in ('y', 'yes'):
        raise GraphError(f'master.source stays {source}: nothing would follow the keys')


def _wait_for_the_handles_place(client: GraphClient) -> None:
    """Raise GraphError if another node keeps publishing the handle topics."""
    if not client.wait_until(lambda: not handle_senders(client.node), _GONE_S):
        others = ' and '.join(handle_senders(client.node))
        raise GraphError(
            f'the handle topics are already published by {others} ({MASTER_MEASURED} or '
            f'{MASTER_CLUTCH}); a second publisher would be a fault'
        )


def _give_back(
    client: GraphClient, terminal: Terminal, before: dict[str, str | float], patience_s: float
) -> None:
    """Set the master's parameters back; a motion does not restart with nobody looking."""
    if not before:
        return
    # The supervisor has to know that this handle is gone.
    client.wait_until(lambda: False, _SETTLED_S)
    source = before.get('source')
    if source in PLAYS and client.state == 'ENABLED':
        client.ask('pause', patience_s)
        terminal.say(f'paused: master.source {source} starts again when you resume')
    set_parameters(client, MASTER_NODE, before, patience_s)


@contextmanager
def _signals_noted() -> Iterator[list[int]]:
    """Note signals instead of letting them tear the loop apart."""
    noted: list[int] = []
    before = {n: signal.signal(n, lambda number, _: noted.append(number)) for n in _STOPPING}
    try:
        yield noted
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Heard:
    """The last angles of joints or motors on a topic, and when they came by this clock."""

    def __init__(self, client: GraphClient, topic: str, names: tuple[str, ...] = JOINTS) -> None:
        self.position: tuple[float, ...] | None = None
        self.ns = 0
        self._reader = JointReader(names)
        client.listen(JointState, topic, self._take, qos=COMMAND)

    def _take(self, data: bytes, received_ns: int) -> None:
        try:
            self.position = self._reader.read(data).position or None
        except MalformedMessageError:
            return
        self.ns = received_ns

    def since(self, then_ns: int) -> tuple[float, ...] | None:
        return self.position if self.ns > then_ns else None


class _Teleoperation:
    def __init__(
        self,
        client: GraphClient,
        terminal: Terminal,
        sender: HandleSender,
        signals: list[int],
        speed: float,
        scale: float,
    ) -> None:
        self._client = client
        self._terminal = terminal
        self._sender = sender
        self._signals = signals
        self._scale = scale
        self._hand = KeyboardHandle(len(JOINTS), speed)
        self._wanted = _Heard(client, SLAVE_COMMAND)
        self._measured = _Heard(client, SLAVE_MEASURED)
        self._motors = _Heard(client, MOTOR_COMMAND, MOTORS)
        self._taken_ns = self._gripped_ns = time.time_ns()
        # Orders that calibration had before the key for home was pressed; None while it is not.
        self._home: frozenset[int] | None = None
        self._quit = False
        self._shown: tuple[str, ...] = ()

    def run(self) -> int:
        """Take turns until the operator quits, a signal comes or the terminal is lost."""
        due_ns = shown_ns = time.monotonic_ns()
        try:
            self._terminal.open()
            self._terminal.say(
                'Arrows or WASD held: bend, from the first repeat of a key to 0.15 s after the '
                'last. [ ] speed,\nE enable, P pause, H held: home, Q quit, any other key: stop. '
                'Angles are wanted / measured.'
            )
            while not self._quit and not self._signals:
                now_ns = time.monotonic_ns()
                turn = self._take_turn(now_ns)
                if now_ns >= shown_ns:
                    shown_ns = now_ns + _SHOWN_NS
                    self._show(turn)
                due_ns = max(due_ns + _TURN_NS, time.monotonic_ns())
                time.sleep(max(0, due_ns - time.monotonic_ns()) * 1e-9)
        except TerminalLostError:
            self._signals.append(signal.SIGHUP)
        finally:
            self._let_go()
        return 128 + self._signals[0] if self._signals else 0

    def _let_go(self) -> None:
        """Release the clutch before anything else, and do not leave a way home to itself."""
        self._sender.press(False, time.time_ns())
        if self._home is not None and not self._is_home(self._home):
            self._client.order('pause')
        self._home = None

    def _take_turn(self, now_ns: int) -> Turn:
        keys = self._terminal.read()
        self._client.hear()
        wall_ns = time.time_ns()
        turn = self._hand.turn(
            now_ns,
            keys,
            self._hindrance(wall_ns),
            self._wanted.since(max(self._gripped_ns, wall_ns - _FRESH_NS)),
            self._scale,
        )
        if turn.clutch != self._sender.clutch:
            self._gripped_ns = wall_ns
            self._sender.press(turn.clutch, wall_ns)
        self._sender.send(wall_ns, turn.position)
        if turn.homing != (self._home is not None):
            if turn.homing:
                self._home = frozenset(self._client.orders)
                self._client.order(HOME)
            else:
                self._let_go()
        for request in turn.requests:
            self._obey(request)
        return turn

    def _hindrance(self, wall_ns: int) -> str:
        """What forbids motion; empty for nothing."""
        client = self._client
        if wall_ns - client.state_ns > _SUPERVISED_NS:
            return 'the supervisor is silent'
        if client.state != 'ENABLED':
            todo = {'DISABLED': 'E enables', 'PAUSED': 'E resumes'}.get(client.state, 'FAULT')
            return client.why or todo
        master = client.health.get(MASTER)
        if master is not None and master.received_ns > self._taken_ns + 2 * _SUPERVISED_NS:
            source = master.values.get('source', FOLLOW_THE_HANDLE)
            if source != FOLLOW_THE_HANDLE:
                return f'master.source is {source}'
        if self._home is None and self._client.underway is not None:
            return 'a calibration or a way home has the slave'
        return ''

    def _is_home(self, known: frozenset[int]) -> bool:
        order = self._client.order_since(known, HOME)
        return order is not None and order.state == OrderState.SUCCEEDED

    def _obey(self, request: Request) -> None:
        if request is Request.QUIT:
            self._quit = True
        elif request is Request.PAUSE:
            self._client.order('pause')
        else:
            self._client.order('resume' if self._client.state == 'PAUSED' else 'enable')

    def _show(self, turn: Turn) -> None:
        """Write a line where state, lamp, speed or the reason why it does not move has changed."""
        wall_ns = time.time_ns()
        wanted = self._wanted.since(wall_ns - _FRESH_NS)
        measured = self._measured.since(wall_ns - 2 * _FRESH_NS)
        # What is wanted is obeyed where the compensator makes commands for the motors of it.
        obeyed = self._motors.since(wall_ns - _FRESH_NS) is not None
        follows = turn.clutch and wanted is not None and obeyed
        lamp = 'HOME' if turn.homing else 'FOLLOW' if follows else 'HELD' if turn.clutch else 'OPEN'
        speed = f'{math.degrees(self._hand.speed):.0f} deg/s x {self._scale:.2g}'
        shown = self._client.state, lamp, speed, printable(self._why(turn, follows))
        if shown == self._shown:
            return
        self._shown = shown
        joints = '  '.join(
            f'{name} {_degrees(wanted, k)}/{_degrees(measured, k)}' for k, name in enumerate(JOINTS)
        )
        self._terminal.say(f'{shown[0]:<8} {lamp:<6} {joints} deg  {speed}  {shown[3]}'.rstrip())

    def _why(self, turn: Turn, follows: bool) -> str:
        """Why it does not move, in few words."""
        if turn.clutch:
            at_limit = [name for name, is_at in zip(JOINTS, turn.at_limit, strict=True) if is_at]
            if at_limit:
                return f'{" and ".join(at_limit)} at its limit'
            master = self._client.health.get(MASTER)
            reason = master.message if master is not None else 'silent'
            return '' if follows else f'the master does not follow: {reason}'
        return self._hindrance(time.time_ns()) or self._hand.dead_man.reason


def _degrees(angles: tuple[float, ...] | None, k: int) -> str:
    return f'{math.degrees(angles[k]):+6.1f}' if angles is not None else '    --'
