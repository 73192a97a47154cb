"""The operator's side of a running graph: asks it for something, and hears what it answers."""

import math
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.client import Client
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from rclpy.time import Time
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger

from endoscope_core.closed_on_exit import ClosedOnExit
from endoscope_core.errors import EndoscopeError
from endoscope_nodes.names import (
    CALIBRATION_BEGUN,
    CALIBRATION_RESULT,
    CALIBRATION_RUN,
    COMPENSATOR_STATE,
    DIAGNOSTICS,
    FACTOR,
    HOME_REACHED,
    MOTION_SESSION,
    NOT_RECEIVED,
    OPERATING_STATE,
    PROCEDURE_WAITING,
    STATE_COMMAND,
)
from endoscope_nodes.qos import EVENT, profile
from endoscope_nodes.raw_subscription import RawSubscription
from endoscope_nodes.topics import Qos

PATIENCE_S = 20.0
WHOLE_S = 10.0
"""How long a graph that has just been started may take until all its streams are heard."""
POLL_S = 0.05
SUPERVISOR = 'supervisor: operating state'
RECORDER = 'recorder: recording'
PROCEDURE = 'calibration: procedure'
CONSOLE = 'console: commands'
LOCK_STEP = 'conductor: lock-step'
COMMANDS = ('compensator: commands', 'compensator: calibration commands', 'motor_driver: commands')
_OPENS = {'enable': 'ENABLED', 'resume': 'ENABLED', 'disable': 'DISABLED', 'pause': 'PAUSED'}
_TO_MOTION = ('enable', 'resume', 'home')
# What was refused is told at once; the same words a second later are an old story.
_JUST_NOW_S = 0.1
_REPEATED_AFTER_S = 1.0
# A graph that simulates slower still counts as one that has stopped.
_SLOWEST = 0.1
# An `enable` that brings a node's trouble to light is a fault within this time.
_STEADY_S = 0.3
# A result tells its duration with nine digits.
_SAME_BEGIN_S = 1e-6
# A loop that reads as seldom as this still hears every word.
_HEARD = profile(Qos(200))
_HEARD_LATCHED = profile(Qos(200, latched=True))


def _never() -> bool:
    return False


class GraphRefusedError(EndoscopeError):
    """The graph refused what was asked of it, or did not do it in time."""


class NoGraphError(GraphRefusedError):
    """Nobody answers."""


@dataclass(frozen=True)
class Health:
    """What a node last said of a part of itself on ``/diagnostics``, or of a result.

    Attributes
    ----------
    level
        0 for good health, 1 for a warning, 2 for an error.
    message
        In words.
    values
        By key.
    stamp_ns, received_ns
        When it was said by the graph's clock, and heard by this machine's.
    session
        Motion session that it is of, for results.
    """

    level: int
    message: str
    values: dict[str, str]
    stamp_ns: int
    received_ns: int
    session: str = ''


class GraphClient(ClosedOnExit):
    """Listens to a graph and asks it for things; it hears only while it waits for something.

    Parameters
    ----------
    node
        In the namespace of the graph, by which to listen and ask.
    serve
        Lets the node be served for so many seconds; what is waited for is looked at in between.
    clock
        Time in s by which patience is measured.

    Attributes
    ----------
    state, session
        Operating state and motion session as last heard; empty before.
    state_ns, open_ns
        When the state was heard, and when a session was last heard to be open.
    health
        By status, without the namespace: ``supervisor: operating state``.
    heard_ns
        When each node was last heard on ``/diagnostics``.
    calibration, compensator
        Last result of a calibration, and the model in force; None before the first.
    told
        Called with what is waited for, in words, before an order can be given.
    """

    def __init__(
        self,
        node: Node,
        serve: Callable[[float], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.node = node
        self.serve = serve
        self._clock = clock
        self.state = self.session = ''
        self.state_ns = self.open_ns = 0
        self.health: dict[str, Health] = {}
        self.heard_ns: dict[str, int] = {}
        self.calibration: Health | None = None
        self.compensator: Health | None = None
        self.told: Callable[[str], object] = lambda what: None
        self._busy = False
        self._prefix = f'{node.get_namespace().rstrip("/")}/'
        self._orders = node.create_publisher(String, STATE_COMMAND, EVENT)
        self._heard: list[tuple[RawSubscription, Callable[[bytes, int], object]]] = []
        self.listen(String, OPERATING_STATE, self._on_state, latched=True)
        self.listen(Header, MOTION_SESSION, self._on_session)
        self.listen(DiagnosticArray, DIAGNOSTICS, self._on_health)
        self.listen(DiagnosticArray, CALIBRATION_RESULT, self._on_result, latched=True)
        self.listen(DiagnosticArray, COMPENSATOR_STATE, self._on_model, latched=True)
        self._clients: dict[str, Client] = {}

    def listen(
        self,
        kind: type,
        topic: str,
        take: Callable[[bytes, int], object],
        *,
        latched: bool = False,
        qos: QoSProfile | None = None,
    ) -> RawSubscription:
        """Hear one more topic: ``take`` gets each message's bytes and its receipt in ns."""
        asked = qos or (_HEARD_LATCHED if latched else _HEARD)
        subscription = RawSubscription(self.node, kind, topic, asked)
        self._heard.append((subscription, take))
        return subscription

    def hear(self) -> None:
        """Take all that has come."""
        for subscription, take in self._heard:
            for data, info in subscription.take():
                take(data, info['received_timestamp'])

    def is_connected(self) -> bool:
        """Whether every topic that is heard has a sender, and the commands a reader."""
        return self._is_heard() and all(s.count_publishers() for s, _ in self._heard)

    def _on_state(self, data: bytes, received_ns: int) -> None:
        self.state = deserialize_message(data, String).data
        self.state_ns = received_ns

    def _on_session(self, data: bytes, received_ns: int) -> None:
        self.session = deserialize_message(data, Header).frame_id
        if self.session:
            self.open_ns = received_ns

    def _on_health(self, data: bytes, received_ns: int) -> None:
        message = deserialize_message(data, DiagnosticArray)
        for status in message.status:
            if not status.name.startswith(self._prefix):
                continue
            name = status.name.removeprefix(self._prefix)
            health = _health(message, status, received_ns)
            self.health[name] = health
            self.heard_ns[name.partition(':')[0]] = received_ns
            if name == PROCEDURE and health.message != PROCEDURE_WAITING:
                self._busy = True

    def _on_result(self, data: bytes, received_ns: int) -> None:
        message = deserialize_message(data, DiagnosticArray)
        if message.status:
            self.calibration = _health(message, message.status[0], received_ns)

    def _on_model(self, data: bytes, received_ns: int) -> None:
        message = deserialize_message(data, DiagnosticArray)
        if message.status:
            self.compensator = _health(message, message.status[0], received_ns)

    @property
    def why(self) -> str:
        """Why the supervisor forbids motion; empty where it does not."""
        said = self.health.get(SUPERVISOR)
        if said is None:
            return ''
        return said.values.get('cause') or said.values.get('present causes', '')

    @property
    def factor(self) -> float | None:
        """Simulated seconds in a real one, as last told; None where time is real, or before."""
        said = self.health.get(LOCK_STEP)
        factor = math.nan if said is None else float(said.values[FACTOR])
        return factor if math.isfinite(factor) else None

    @property
    def where(self) -> str:
        """Namespace and domain, in words."""
        namespace = self.node.get_namespace()
        return f'namespace {namespace}, ROS_DOMAIN_ID {self.node.context.get_domain_id()}'

    def nodes(self) -> list[str]:
        """Names of the nodes in the namespace, without this one."""
        own, namespace = self.node.get_name(), self.node.get_namespace()
        found = self.node.get_node_names_and_namespaces()
        return sorted({name for name, space in found if space == namespace and name != own})

    def wait_until(self, condition: Callable[[], bool], patience_s: float = PATIENCE_S) -> bool:
        """Listen until something has come true, or for so long; whether it has."""
        left_s, before = patience_s, self._clock()
        while True:
            self.hear()
            if condition():
                return True
            now = self._clock()
            # What a slow graph says once a second of its time is waited for so much longer.
            left_s -= (now - before) * max(_SLOWEST, min(1.0, self.factor or 1.0))
            before = now
            if left_s < 0.0:
                return False
            self.serve(POLL_S)

    def wait_for(
        self, condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S
    ) -> None:
        """Listen until something has come true.

        Raises
        ------
        GraphRefusedError
            It has not within so long.
        """
        if not self.wait_until(condition, patience_s):
            raise GraphRefusedError(f'waited {patience_s:g} s in vain for {what}')

    def find(self, patience_s: float) -> None:
        """Wait until the supervisor is heard and hears.

        Raises
        ------
        NoGraphError
            Nobody does within so long.
        """
        if self.wait_until(lambda: bool(self.state) and self._is_heard(), patience_s):
            return
        others = self.nodes()
        if others:
            raise NoGraphError(
                f'no supervisor answers in {self.where}; there are {", ".join(others)}'
            )
        raise NoGraphError(f'no graph answers in {self.where}: start one with `graph`')

    def _is_heard(self) -> bool:
        known = self.node.get_subscriptions_info_by_topic(self._orders.topic_name)
        return 0 < len(known) <= self._orders.get_subscription_count()

    def order(self, command: str) -> None:
        """Give a state command and wait for nothing."""
        self._orders.publish(String(data=command))

    def ask(
        self,
        command: str,
        patience_s: float = PATIENCE_S,
        withdrawn: Callable[[], bool] = _never,
    ) -> str:
        """Give a state command and wait for the state that it leads to; that state.

        Parameters are those of :meth:`ask_and_see`.

        Raises
        ------
        GraphRefusedError
            With the supervisor's reason, or because the state is not reached in time.
        """
        target = _OPENS[command]
        asked_ns = time.time_ns()
        self._ask(
            command,
            lambda: self.state == target and self.state_ns > asked_ns,
            target,
            patience_s,
            withdrawn,
        )
        return target

    def ask_and_see(
        self,
        command: str,
        patience_s: float = PATIENCE_S,
        withdrawn: Callable[[], bool] = _never,
    ) -> str:
        """Give a state command, and see whether the state lasts; that state.

        Parameters
        ----------
        command
            Of the supervisor.
        patience_s
            For how long to wait.
        withdrawn
            Whether it is not wanted any more, so that it is not given again.

        Raises
        ------
        GraphRefusedError
            As of :meth:`ask`, or because a node's trouble came to light at once; with its cause.
        """
        state = self.ask(command, patience_s, withdrawn)
        if state == 'ENABLED' and self.wait_until(lambda: self.state != state, _STEADY_S):
            self.wait_until(lambda: bool(self.why) or withdrawn(), patience_s)
            raise GraphRefusedError(f'{self.state}: {self.why or "asked for meanwhile"}')
        return state

    def _ask(
        self,
        command: str,
        done: Callable[[], bool],
        what: str,
        patience_s: float,
        withdrawn: Callable[[], bool],
    ) -> None:
        """Give a command, again where it brought no answer, until it is done."""
        asked_ns = time.time_ns()
        begun_in = self.state
        end = self._clock() + patience_s
        while self._clock() <= end:
            if withdrawn():
                raise GraphRefusedError(f'{command} was withdrawn before it was answered')
            if command in _TO_MOTION and begun_in and self.state != begun_in:
                # What has ended motion meanwhile must not be undone by an order from before it.
                raise GraphRefusedError(f'{self.state} instead of {what}: {self.why or "no cause"}')
            self.order(command)
            if self.wait_until(lambda: done() or bool(self._refused(asked_ns)), _REPEATED_AFTER_S):
                refused = self._refused(asked_ns)
                if self._becomes_whole(refused):
                    return self._ask(command, done, what, patience_s, withdrawn)
                if refused:
                    raise GraphRefusedError(refused)
                return None
        raise GraphRefusedError(f'waited {patience_s:g} s in vain for {what}')

    @property
    def awaited(self) -> str:
        """What the supervisor has never heard and has to hear; empty where the graph is whole."""
        said = self.health.get(SUPERVISOR)
        causes = '' if said is None else said.values.get('present causes', '')
        return '; '.join(cause for cause in causes.split('; ') if cause.endswith(NOT_RECEIVED))

    def _becomes_whole(self, refused: str) -> bool:
        """Wait where that was the reason of a refusal; whether the streams have come since."""
        if NOT_RECEIVED not in refused:
            return False
        self.told(f'waits until the graph is whole: {refused}')
        return self.wait_until(lambda: not self.awaited, WHOLE_S)

    def _refused(self, asked_ns: int) -> str:
        """What was refused just now, by the supervisor or calibration; empty for nothing."""
        for name, text, age, begins in (
            (SUPERVISOR, 'last refusal', 'since last refusal [s]', ''),
            (PROCEDURE, 'last', 'since last [s]', 'home: '),
        ):
            said = self.health.get(name)
            if said is None or said.received_ns <= asked_ns or age not in said.values:
                continue
            words = said.values[text]
            if float(said.values[age]) < _JUST_NOW_S and words and words.startswith(begins):
                return words
        return ''

    def home(self, patience_s: float = PATIENCE_S, withdrawn: Callable[[], bool] = _never) -> str:
        """Go home, and wait until the slave is there; what calibration says of it.

        Parameters are those of :meth:`ask_and_see`.

        Raises
        ------
        GraphRefusedError
            With the reason of the supervisor or of calibration.
        """
        asked_ns = time.time_ns()
        self._busy = False
        self._ask(
            'home',
            lambda: self._begun(asked_ns),
            'the way home: calibration does not begin it',
            patience_s,
            withdrawn,
        )
        said = self._procedure_to_its_end(patience_s)
        if said != HOME_REACHED:
            raise GraphRefusedError(said)
        return said

    def _begun(self, asked_ns: int) -> bool:
        said = self.health.get(PROCEDURE)
        return self._busy and said is not None and said.received_ns > asked_ns

    def _procedure_to_its_end(
        self,
        patience_s: float,
        begun_ns: int = -1,
        progress: Callable[[str, float], None] = lambda step, share: None,
        is_told: Callable[[], bool] = _never,
    ) -> str:
        """Wait while calibration moves the slave, or until its end is told; what it said last."""
        while not is_told():
            said = self.health.get(PROCEDURE)
            heard_ns = 0 if said is None else said.received_ns
            if said is not None and said.message != PROCEDURE_WAITING:
                progress(said.message, float(said.values['progress']))
            elif said is not None and said.stamp_ns > begun_ns:
                return said.values['last']

            def says_more(heard_ns: int = heard_ns) -> bool:
                said = self.health.get(PROCEDURE)
                return is_told() or (said is not None and said.received_ns > heard_ns)

            if not self.wait_until(says_more, patience_s):
                raise GraphRefusedError(f'calibration has been silent for {patience_s:g} s')
        return ''

    def calibrate(
        self,
        progress: Callable[[str, float], None] = lambda step, share: None,
        patience_s: float = PATIENCE_S,
    ) -> Health:
        """Calibrate, and wait for the result.

        Parameters
        ----------
        progress
            Called about once a second with what is being done and the share that is done.
        patience_s
            For how long calibration may say nothing.

        Raises
        ------
        GraphRefusedError
            It was refused or aborted, or the tube is of no known class; with the reason.
        """
        try:
            answer = self.trigger(CALIBRATION_RUN, patience_s)
        except GraphRefusedError as error:
            if not self._becomes_whole(str(error)):
                raise
            answer = self.trigger(CALIBRATION_RUN, patience_s)
        begun = re.fullmatch(CALIBRATION_BEGUN.format(r'(\d+)'), answer)
        if begun is None:
            raise GraphRefusedError(f'{CALIBRATION_RUN} does not say when it has begun: {answer!r}')
        begun_ns = int(begun[1])

        def is_told() -> bool:
            return self.calibration is not None and _is_of(self.calibration, begun_ns)

        said = self._procedure_to_its_end(patience_s, begun_ns, progress, is_told)
        self.wait_for(is_told, f'{CALIBRATION_RESULT}; calibration says: {said}', patience_s)
        result = cast(Health, self.calibration)
        if result.level != 0:
            raise GraphRefusedError(result.message)
        return result

    def trigger(self, service: str, patience_s: float = PATIENCE_S) -> str:
        """Call a service that only begins or ends something; what it answers.

        Raises
        ------
        GraphRefusedError
            With the node's reason.
        """
        answer = self.call(Trigger, service, Trigger.Request(), patience_s)
        if not answer.success:
            raise GraphRefusedError(answer.message)
        return str(answer.message)

    def client(self, kind: type, service: str) -> Client:
        """Client of a service; made when it is asked for first."""
        if service not in self._clients:
            self._clients[service] = self.node.create_client(kind, service)
        return self._clients[service]

    def call(self, kind: type, service: str, request: Any, patience_s: float = PATIENCE_S) -> Any:
        """Call a service and wait for its answer.

        Raises
        ------
        NoGraphError
            Nobody serves it, or nobody answers.
        """
        client = self.client(kind, service)
        if not self.wait_until(client.service_is_ready, patience_s):
            raise NoGraphError(f'nobody serves {service} in {self.where}')
        return self.answer(client.call_async(request), service, patience_s)

    def answer(self, future: Future, what: str, patience_s: float = PATIENCE_S) -> Any:
        """Wait for the answer to a call.

        Raises
        ------
        NoGraphError
            Nobody answers.
        """
        if not self.wait_until(future.done, patience_s):
            raise NoGraphError(f'{what} has not answered for {patience_s:g} s')
        return future.result()

    def close(self) -> None:
        """Listen and ask no more; the node remains."""
        for subscription, _ in self._heard:
            subscription.close()
        for client in self._clients.values():
            self.node.destroy_client(client)
        self.node.destroy_publisher(self._orders)


def _health(message: DiagnosticArray, status: DiagnosticStatus, received_ns: int) -> Health:
    return Health(
        status.level[0],
        status.message,
        {item.key: item.value for item in status.values},
        Time.from_msg(message.header.stamp).nanoseconds,
        received_ns,
        message.header.frame_id,
    )


def _is_of(result: Health, begun_ns: int) -> bool:
    """Whether a result is of the calibration that began then.

    Its stamp alone does not tell: in simulated time one may end in the instant in which the next
    begins, or in that in which it began itself.
    """
    duration = float(result.values.get('duration', 'nan'))
    return abs((result.stamp_ns - begun_ns) * 1e-9 - duration) < _SAME_BEGIN_S
