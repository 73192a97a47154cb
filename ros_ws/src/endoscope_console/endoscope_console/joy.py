"""The topic ``joy`` as one more client: a device by the same rules as a page."""

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Joy

from endoscope_console.access import OPERATOR
from endoscope_console.clients import Client
from endoscope_console.graph_side import GraphSide
from endoscope_console.operations import Operations
from endoscope_console.teleop.frames import MalformedFrameError
from endoscope_console.teleop.joy_mapping import JoyMapping
from endoscope_console.teleop.operator import Reason
from endoscope_core.errors import EndoscopeError
from endoscope_nodes.runtime.qos import profile
from endoscope_nodes.runtime.streams import RawSubscription
from endoscope_nodes.topics import Qos

TOPIC = 'joy'
_QUEUE = profile(Qos(50, reliable=False))
_LET_GO_NS = 10_000_000_000


class JoyHand:
    """Reads the topic; its dead-man claims the lease where nobody has it."""

    def __init__(self, graph: GraphSide, operations: Operations, mapping: JoyMapping) -> None:
        self._operations = operations
        self._mapping = mapping
        self._client = Client('joy', 'command', OPERATOR, f'topic {TOPIC}')
        self._subscription = RawSubscription(graph.client.node, Joy, TOPIC, _QUEUE)
        self._graph = graph
        self._pressed_ns = 0
        self._claiming = False
        self._claimed = 0

    @property
    def connected(self) -> bool:
        """Whether somebody sends the topic."""
        return self._subscription.count_publishers() > 0

    def turn(self, now_ns: int, wall_ns: int) -> None:
        """Take what waits; at a time in ns by a steady clock, and by this machine's."""
        for data, info in self._subscription.take():
            message = deserialize_message(data, Joy)
            arrived_ns = now_ns - max(0, wall_ns - info['received_timestamp'])
            stamp = message.header.stamp
            stamp_s = stamp.sec + stamp.nanosec * 1e-9
            try:
                frame = self._mapping.frame(
                    message.axes, message.buttons, stamp_s or arrived_ns * 1e-9
                )
            except MalformedFrameError:
                self._operations.refuse(self._client, Reason.MALFORMED, now_ns)
                continue
            if frame.pressed:
                self._pressed_ns = arrived_ns
                free = not self._operations.lease.holder and not self._claiming
                # Who was refused, or has lost it, asks with a new grip.
                if free and frame.grip != self._claimed:
                    self._claimed = frame.grip
                    self._claim()
            holds = self._operations.lease.holder == self._client.id
            if holds:
                self._claimed = frame.grip
                self._operations.hear(self._client, frame, arrived_ns)
            if holds and self._mapping.pause:
                self._graph.client.order('pause')
                self._graph.log('state pause', self._client.id, self._client.address, True, '')
        idle = now_ns - self._pressed_ns > _LET_GO_NS
        if idle and not self._claiming and self._operations.lease.holder == self._client.id:
            self._operations.closed(self._client, 'nobody has held on for 10 s')

    def _claim(self) -> None:
        self._claiming = True
        self._operations.soon(self._take_the_controls())

    async def _take_the_controls(self) -> None:
        try:
            await self._operations.claim(self._client, take=False)
            ok, why = True, ''
        except EndoscopeError as error:
            ok, why = False, str(error)
        finally:
            self._claiming = False
        self._graph.log('claim', self._client.id, self._client.address, ok, why)

    def close(self) -> None:
        """Leave the topic."""
        self._subscription.close()
