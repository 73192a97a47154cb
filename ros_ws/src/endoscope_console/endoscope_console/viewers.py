"""Read-only access to the topics of a graph for Foxglove and Lichtblick.

The server of the Foxglove SDK does not authenticate: it checks neither Origin nor Host and knows no
token, so every program of this machine, and a page whose browser allows it 127.0.0.1, can read the
topics.  Therefore it is started on request only, listens nowhere else, and offers no capability by
which anything could be sent to the graph.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.node import Node

from endoscope_bags.message_types import JOINT_STATE, message_type
from endoscope_core.errors import EndoscopeError
from endoscope_nodes.runtime.environment import joined_node
from endoscope_nodes.runtime.qos import profile
from endoscope_nodes.runtime.recorded_topics import message_class
from endoscope_nodes.runtime.streams import RawSubscription
from endoscope_nodes.topics import TOPICS, GraphTopic, Qos

try:
    import foxglove
    from foxglove import Channel, Context, Schema
    from foxglove.websocket import ChannelView, Client, ServerListener
except ModuleNotFoundError as error:
    raise EndoscopeError(
        '--viewers needs the Foxglove SDK: `make -C ros_ws viewers` installs it'
    ) from error

NODE = 'console_viewers'
HOST = '127.0.0.1'

_PERIOD_S = 0.01
_ENDS_S = 5.0
# Of a stream only the newest counts. What comes rarely is passed on to the last message.
_STREAM = Qos(1, reliable=False)
_EVENTS = Qos(100)


class ViewedTopic:
    """A topic that viewers can see, and that is heard while one of them does."""

    def __init__(self, node: Node, topic: GraphTopic, context: Context) -> None:
        self._node = node
        self._topic = topic
        self._subscription: RawSubscription | None = None
        self._last: bytes | None = None
        self._asked = threading.Event()
        kind = message_type(topic.type)
        self.channel = Channel(
            node.resolve_topic_name(topic.name),
            schema=Schema(name=kind.name, encoding='ros2msg', data=kind.definition.encode('utf-8')),
            message_encoding='cdr',
            context=context,
        )

    def ask_again(self) -> None:
        """Show what is latched to one more viewer; may be called from any thread."""
        self._asked.set()

    def pass_on(self) -> None:
        """Show what has come, as far as somebody looks."""
        if not self.channel.has_sinks():
            self.close()
            return
        asked = self._asked.is_set()
        self._asked.clear()
        if self._subscription is None:
            self._subscription = self._subscribe()
        elif asked and self._last is not None:
            self.channel.log(self._last)
        for data, info in self._subscription.take():
            self._show(data, info)

    def _subscribe(self) -> RawSubscription:
        latched = self._topic.asked.latched
        stream = self._topic.type == JOINT_STATE and not latched
        qos = _STREAM if stream else Qos(_EVENTS.depth, latched=latched)
        return RawSubscription(
            self._node, message_class(self._topic.type), self._topic.name, profile(qos)
        )

    def _show(self, data: bytes, info: dict[str, int]) -> None:
        if self._topic.asked.latched:
            self._last = data
        self.channel.log(data, log_time=info['received_timestamp'])

    def close(self) -> None:
        """Unsubscribe from the topic."""
        if self._subscription is not None:
            self._subscription.close()
            self._subscription, self._last = None, None


class _Listener(ServerListener):
    def __init__(self, topics: dict[int, ViewedTopic]) -> None:
        self._topics = topics

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Show a new viewer what is latched."""
        self._topics[channel.id].ask_again()


@contextmanager
def viewers(namespace: str, port: int) -> Iterator[str]:
    """Let viewers read a graph's topics, at up to 100 Hz; yields the address of the WebSocket."""
    context = Context()
    with joined_node(NODE, namespace) as node:
        topics = [ViewedTopic(node, topic, context) for topic in TOPICS if topic.recorded]
        listener = _Listener({topic.channel.id(): topic for topic in topics})
        try:
            server = foxglove.start_server(
                name=f'endoscope {node.get_namespace()}',
                host=HOST,
                # 0 is any that is free.
                port=port,
                capabilities=[],
                server_listener=listener,
                context=context,
            )
        except (RuntimeError, OSError) as error:
            raise EndoscopeError(
                f'no viewers at {HOST}:{port}: {error}; give another --viewers-port'
            ) from error
        ended = threading.Event()
        thread = threading.Thread(
            target=_pass_on, args=(topics, ended), name='viewers', daemon=True
        )
        thread.start()
        try:
            yield f'ws://{HOST}:{server.port}'
        finally:
            ended.set()
            thread.join(_ENDS_S)
            server.stop()
            for topic in topics:
                topic.close()
                topic.channel.close()


def _pass_on(topics: list[ViewedTopic], ended: threading.Event) -> None:
    while not ended.wait(_PERIOD_S):
        for topic in topics:
            topic.pass_on()
