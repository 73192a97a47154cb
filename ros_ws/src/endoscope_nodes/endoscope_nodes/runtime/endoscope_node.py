"""What every node of the endoscope has: the shared ticker and rig, parameters, diagnostics."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from rclpy.clock import Clock, ClockType, ROSClock
from rclpy.event_handler import QoSSubscriptionEventType
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rclpy.time import Time
from std_srvs.srv import Trigger

from endoscope_core.errors import EndoscopeError
from endoscope_nodes.names import CLOCK_NODE
from endoscope_nodes.runtime.declared_parameters import declare_parameters
from endoscope_nodes.runtime.diagnostics import Diagnostics
from endoscope_nodes.runtime.environment import EventlessNode
from endoscope_nodes.runtime.node_context import NAMESPACE, NodeContext
from endoscope_nodes.runtime.node_parameters import FOR_SESSION
from endoscope_nodes.runtime.parameters import ParameterError, changed
from endoscope_nodes.runtime.ticker import Ticker


class Beside:
    """Computes in a thread; in simulated time that nobody paces at once, so that it is the same."""

    def __init__(self, ticker: Ticker) -> None:
        self._ticker = ticker
        self._thread = ThreadPoolExecutor(1)

    def submit[**P, T](
        self, compute: Callable[P, T], *args: P.args, **kwargs: P.kwargs
    ) -> Future[T]:
        if self._ticker.paced or not self._ticker.simulated:
            return self._thread.submit(compute, *args, **kwargs)
        done: Future[T] = Future()
        try:
            done.set_result(compute(*args, **kwargs))
        except EndoscopeError as error:
            done.set_exception(error)
        return done

    def close(self) -> None:
        self._thread.shutdown()


class EndoscopeNode(EventlessNode):
    """A node in the ``/endoscope`` namespace that lives in a process with others."""

    def __init__(self, name: str, context: NodeContext) -> None:
        super().__init__(
            name,
            context=context.context,
            namespace=NAMESPACE,
            parameter_overrides=context.overrides_of(name),
        )
        self.exit_code = 0  # what the process should say when it ends
        self.given: dict[str, object] = {}  # values of its parameters that are not the defaults
        self._by_default = context.chosen if name == CLOCK_NODE else {}
        self._matched: list[rclpy_implementation.EventHandle] = []
        self.ticker = context.ticker_of(self)  # shared, as the rig, by all nodes of the process
        self.rig = context.rig
        self.diagnostics = Diagnostics(self, self.ticker)  # published on ``/diagnostics``

    def parameters[P](
        self,
        kind: type[P],
        on_change: Callable[[P], None] | None = None,
        check: Callable[[P], object] | None = None,
    ) -> P:
        """Declare the parameters of the dataclass ``kind``; see :func:`declare_parameters`."""
        values = declare_parameters(self, kind, on_change, check)
        self.given |= {
            name: value for name, value in changed(values).items() if name not in self._by_default
        }
        return values

    def end_session(self) -> None:
        """Let the parameters fall back that were set for the motion session which has ended."""
        if self.has_parameter(FOR_SESSION) and self.get_parameter(FOR_SESSION).value:
            done = self.set_parameters_atomically([Parameter(FOR_SESSION, value=False)])
            if not done.successful:
                self.get_logger().error(f'parameters of a session stay: {done.reason}')

    def create_subscription(
        self, msg_type: type, topic: str, callback: Any, qos_profile: Any, **how: Any
    ) -> Subscription:
        """Subscribe; in simulated time the next tick waits until the callback is done."""
        if self._is_in_lock_step:
            name = self.resolve_topic_name(topic)
            callback = self.ticker.in_flight.taken(self, name, callback)
        return super().create_subscription(msg_type, topic, callback, qos_profile, **how)

    def create_publisher(
        self, msg_type: type, topic: str, qos_profile: Any, **how: Any
    ) -> Publisher:
        """Offer a topic; in simulated time the next tick waits for its readers."""
        publisher = super().create_publisher(msg_type, topic, qos_profile, **how)
        if self._is_in_lock_step:
            sent, topic = self.ticker.in_flight.sent, publisher.topic_name
            publisher.publish = sent(topic, publisher.publish)  # type: ignore[assignment, method-assign]
            vars(publisher)['publish_raw'] = sent(topic, publisher.handle.publish_raw)
        return publisher

    @property
    def _is_in_lock_step(self) -> bool:
        ticker = getattr(self, 'ticker', None)
        return ticker is not None and ticker.simulated

    def serve(self, service: str, answer: Callable[[], tuple[bool, str]]) -> None:
        """Serve a `Trigger`: `answer` says whether it was done, and what came of it, or why not."""

        def respond(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = answer()
            return response

        self.create_service(Trigger, service, respond)

    def matched_event(self, subscription: Subscription) -> rclpy_implementation.EventHandle:
        """Return what counts the senders of a subscription, to be asked; it ends with the node."""
        event = rclpy_implementation.EventHandle(
            subscription.handle, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED
        )
        self._matched.append(event)
        return event

    def destroy_node(self) -> None:
        """Leave the graph."""
        # An event keeps its subscription in the graph.
        for event in self._matched:
            event.destroy_when_not_in_use()
        super().destroy_node()

    def operate(self, words: str) -> str:
        """Return the command by which an operator does something to the graph of this node."""
        namespace = self.get_namespace().strip('/')
        return f'endoscope operate {words}' + (
            '' if namespace == NAMESPACE else f' --namespace {namespace}'
        )

    def require_real_time(self, device: str) -> None:
        """Refuse a real device in simulated time."""
        if self.ticker.simulated:
            raise ParameterError(
                f'{self.get_name()}: the device is {device}, which needs real time; '
                "give 'simulated', or leave 'use_sim_time' out"
            )

    @property
    def announcement(self) -> str:
        """What it is, in the line that reports that the process can be operated; may be empty."""
        return ''

    @property
    def waiting(self) -> str:
        """What it waits for before it can be operated; empty for nothing."""
        return ''

    def get_clock(self) -> Clock:
        """Return the node's clock, which in simulated time shows that of the ticker."""
        clock = super().get_clock()
        ticker = getattr(self, 'ticker', None)
        if ticker is not None and ticker.simulated and isinstance(clock, ROSClock):
            now = Time(nanoseconds=ticker.now_ns(), clock_type=ClockType.ROS_TIME)
            clock.set_ros_time_override(now)
        return clock

    def close(self) -> None:
        """Finish what must not be cut off; called once, before the node is destroyed."""
