"""The operator's side of a running graph: asks it for something, and hears what it answers."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, cast

from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from endoscope_core.calibration import CalibrationStep
from endoscope_core.calibration.calibration_run import CALIBRATE, HOME, OrderFeedback, OrderState
from endoscope_core.safety.operating_state import CAUSES_PRESENT
from endoscope_nodes import names
from endoscope_nodes.client.graph_listener import (
    EVENTS,
    PATIENCE_S,
    SUPERVISOR,
    GraphError,
    GraphListener,
    Health,
)
from endoscope_nodes.runtime.environment import joined_node
from endoscope_nodes.runtime.qos import EVENT

COMPUTES_S = 60.0
"""How long a calibration may be silent once its motion is over: two slow cores that do other work
besides have taken more than 10 s for class and plant."""
WHOLE_S = 10.0
"""How long a graph that has just been started may take until all its streams are heard."""
_OPENS = {'enable': 'ENABLED', 'resume': 'ENABLED', 'disable': 'DISABLED', 'pause': 'PAUSED'}
_TO_MOTION = ('enable', 'resume', 'home')
_REPEATED_AFTER_S = 1.0
# An `enable` that brings a node's trouble to light is a fault within this time.
_STEADY_S = 0.3


def _never() -> bool:
    return False


class GraphClient(GraphListener):
    """Listens to a graph and asks it for things."""

    def __init__(
        self,
        node: Node,
        serve: Callable[[float], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(node, serve, clock)
        # Called with what is waited for, in words, before an order can be given.
        self.report: Callable[[str], object] = lambda what: None
        self._orders = node.create_publisher(String, names.STATE_COMMAND, EVENT)
        self._clients: dict[str, Client] = {}

    def is_connected(self) -> bool:
        """Whether every topic that is heard has a sender, and the commands a reader."""
        return self._is_heard() and all(s.count_publishers() for s, _ in self._heard)

    def find(self, patience_s: float) -> None:
        """Wait until the supervisor is heard and hears; GraphError if nobody is there."""
        if self.wait_until(lambda: bool(self.state) and self._is_heard(), patience_s):
            return
        others = self.nodes()
        if others:
            raise GraphError(
                f'no supervisor answers in {self.where}; there are {", ".join(others)}'
            )
        raise GraphError(f'no graph answers in {self.where}: start one with `graph`')

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
        withdrawn: Callable[[], object] = _never,
    ) -> str:
        """Give a state command and wait for the state that it leads to; that state."""
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
        withdrawn: Callable[[], object] = _never,
    ) -> str:
        """Give a state command, and see whether the state lasts; that state."""
        state = self.ask(command, patience_s, withdrawn)
        # A node's trouble may come to light at once; its cause follows.
        if state == 'ENABLED' and self.wait_until(lambda: self.state != state, _STEADY_S):
            self.wait_until(lambda: bool(self.why or withdrawn()), patience_s)
            raise GraphError(f'{self.state}: {self.why or "asked for meanwhile"}')
        return state

    def _ask(
        self,
        command: str,
        done: Callable[[], bool],
        what: str,
        patience_s: float,
        withdrawn: Callable[[], object],
    ) -> None:
        """Give a command, again where it brought no answer, until it is done."""
        asked_ns = time.time_ns()
        # A refusal is reported until the next one, by a stamp of the supervisor's.
        self.wait_for(lambda: self.graph_ns > 0, 'the supervisor', patience_s)
        graph_ns, begun_in = self.graph_ns, self.state

        def is_refused() -> bool:
            latest = self.health.get(SUPERVISOR)
            if latest is None or latest.received_ns <= asked_ns or not latest.values[names.REFUSAL]:
                return False
            return int(latest.values[names.REFUSED_NS]) >= graph_ns

        for _ in range(1 + int(patience_s / _REPEATED_AFTER_S)):
            if withdrawn():
                raise GraphError(f'{command} was withdrawn before it was answered')
            if command in _TO_MOTION and begun_in and self.state != begun_in:
                # What has ended motion meanwhile must not be undone by an order from before it.
                raise GraphError(f'{self.state} instead of {what}: {self.why or "no cause"}')
            self.order(command)
            if self.wait_until(
                lambda: done() or is_refused() or bool(withdrawn()), _REPEATED_AFTER_S
            ):
                if not is_refused():
                    if done():
                        return None
                    continue
                refusal = self.health[SUPERVISOR].values
                if refusal[names.REFUSAL_CODE] == CAUSES_PRESENT and self._becomes_whole(
                    refusal[names.REFUSAL]
                ):
                    return self._ask(command, done, what, patience_s, withdrawn)
                raise GraphError(refusal[names.REFUSAL])
        raise GraphError(f'timed out after {patience_s:g} s{self.pace} waiting for {what}')

    def _becomes_whole(self, refused: str) -> bool:
        """Wait where that was the reason of a refusal; whether the streams have come since."""
        if not self.awaited:
            return False
        self.report(f'waits until the graph is whole: {refused}')
        return self.wait_until(lambda: not self.awaited, WHOLE_S)

    def mark(self, text: str, patience_s: float = PATIENCE_S) -> str:
        """Mark this moment for the recorder; the bag that what came before goes to."""
        self.wait_for(lambda: EVENTS in self.health, 'the recorder', patience_s)
        marks = self.node.create_publisher(String, names.RECORDER_MARK, EVENT)
        try:
            self.wait_for(
                lambda: marks.get_subscription_count() > 0,
                'a recorder that keeps what came before',
                patience_s,
            )
            before = self.health[EVENTS].values[names.MARKS]
            marks.publish(String(data=text))
            self.wait_for(
                lambda: self.health[EVENTS].values[names.MARKS] != before,
                "the recorder's answer",
                patience_s,
            )
        finally:
            self.node.destroy_publisher(marks)
        events = self.health[EVENTS]
        if events.level:
            raise GraphError(events.message)
        return events.values[names.LAST_EVENT]

    def home(self, patience_s: float = PATIENCE_S, withdrawn: Callable[[], object] = _never) -> str:
        """Go home, and wait until the slave is there; what calibration says of it."""
        known = self.known_orders(patience_s)
        what = 'the way home: calibration does not begin it'
        self._ask(
            HOME, lambda: self.order_since(known, HOME) is not None, what, patience_s, withdrawn
        )
        ended = self._followed(known, HOME, patience_s)
        if ended.state != OrderState.SUCCEEDED:
            prefix = f'{HOME}: ' if ended.state == OrderState.REJECTED else ''
            raise GraphError(f'{prefix}{ended.words}')
        return ended.words

    def known_orders(self, patience_s: float = PATIENCE_S) -> frozenset[int]:
        """Ids of the orders that calibration has been given; a new one gets none of them."""
        self.wait_for(lambda: bool(self.orders), 'calibration', patience_s)
        return frozenset(self.orders)

    def order_since(self, known: frozenset[int], name: str) -> OrderFeedback | None:
        """The first order of a name that is none of those known, rejected ones last."""
        new = [o for o in list(self.orders.values()) if o.order == name and o.id not in known]
        return max(new, key=lambda order: order.state != OrderState.REJECTED, default=None)

    def _followed(
        self,
        known: frozenset[int],
        name: str,
        patience_s: float,
        progress: Callable[[str, float], None] = lambda step, share: None,
    ) -> OrderFeedback:
        """Wait until an order has ended; how it did."""
        heard: OrderFeedback | None = None

        def says_more() -> bool:
            return self.order_since(known, name) != heard

        while heard is None or heard.state == OrderState.EXECUTING:
            # Once the motion is over it computes, for as long as a busy machine takes.
            moves = heard is None or heard.words != CalibrationStep.DONE
            patience = patience_s if moves else max(patience_s, COMPUTES_S)
            if not self.wait_until(says_more, patience):
                raise GraphError(f'calibration has been silent for {patience:g} s')
            heard = self.order_since(known, name)
            if heard is None:
                raise GraphError(f'calibration has restarted and no longer knows {name}')
            if heard.state == OrderState.EXECUTING:
                progress(heard.words, heard.progress)
        return heard

    def calibrate(
        self,
        progress: Callable[[str, float], None] = lambda step, share: None,
        patience_s: float = PATIENCE_S,
    ) -> Health:
        """Calibrate, and wait for the result; calibration may say nothing for `patience_s`."""
        known = self.known_orders(patience_s)
        try:
            self.trigger(names.CALIBRATION_RUN, patience_s)
        except GraphError as error:
            if not self._becomes_whole(str(error)):
                raise
            self.trigger(names.CALIBRATION_RUN, patience_s)
        ended = self._followed(known, CALIBRATE, patience_s, progress)
        if ended.state != OrderState.SUCCEEDED:
            raise GraphError(ended.words)

        def has_come() -> bool:
            return self.calibration is not None and self.calibration.stamp_ns > ended.id

        self.wait_for(has_come, names.CALIBRATION_RESULT, patience_s)
        return cast(Health, self.calibration)

    def trigger(self, service: str, patience_s: float = PATIENCE_S) -> str:
        """Call a service that only begins or ends something; what it answers."""
        answer = self.call(Trigger, service, Trigger.Request(), patience_s)
        if not answer.success:
            raise GraphError(answer.message)
        return str(answer.message)

    def client(self, kind: type, service: str) -> Client:
        """Client of a service; made when it is asked for first."""
        if service not in self._clients:
            self._clients[service] = self.node.create_client(kind, service)
        return self._clients[service]

    def call(self, kind: type, service: str, request: Any, patience_s: float = PATIENCE_S) -> Any:
        """Call a service and wait for its answer; GraphError if nobody serves it or answers."""
        client = self.client(kind, service)
        if not self.wait_until(client.service_is_ready, patience_s):
            raise GraphError(f'nobody serves {service} in {self.where}')
        return self.answer(client.call_async(request), service, patience_s)

    def answer(self, future: Future, what: str, patience_s: float = PATIENCE_S) -> Any:
        """Wait for the answer to a call."""
        if not self.wait_until(future.done, patience_s):
            raise GraphError(f'{what} has not answered for {patience_s:g} s')
        return future.result()

    def close(self) -> None:
        """Listen and ask no more; the node remains."""
        super().close()
        for client in self._clients.values():
            self.node.destroy_client(client)
        self.node.destroy_publisher(self._orders)


@contextmanager
def joined_graph(name: str, namespace: str, domain: int | None = None) -> Iterator[GraphClient]:
    """Join the graph of a namespace as a node of this name, for as long as the block lasts."""
    with joined_node(name, namespace, domain) as node:
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)

        def serve(seconds: float) -> None:
            end = time.monotonic() + seconds
            while (left := end - time.monotonic()) > 0.0:
                executor.spin_once(timeout_sec=left)

        try:
            with GraphClient(node, serve) as client:
                yield client
        finally:
            executor.shutdown()
