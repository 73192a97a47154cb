"""Streams of messages as bytes: of JointStates at 1 kHz, and any topic emptied by its owner.

Converting a JointState between C and Python costs more than sending it (22 us a hop against 8).
The layout of a stream never changes, so each publisher fills numbers into a prepared message and
each subscription reads them from known places; a message of another layout is parsed again.
"""

import struct
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.type_support import check_for_type_support
from sensor_msgs.msg import JointState

from endoscope_bags.cdr import QUANTITIES, encode_joint_state, joint_state_layout
from endoscope_bags.errors import MalformedMessageError

_SECOND = 1_000_000_000
# Four bytes are never equal to five.
_NOT_LEARNT = (0, 4, bytes(5))
# A hundred joints with long names; whatever is larger is not looked at.
LARGEST_BYTES = 16_384
_STAMP_END = 12


class JointSample(NamedTuple):
    """One JointState, values in the order of the names that the subscriber asked for."""

    stamp_ns: int
    position: tuple[float, ...]  # rad; like the others empty where the message has none
    velocity: tuple[float, ...]  # rad/s
    effort: tuple[float, ...]  # N m (N for wires)
    session: str = ''  # frame of the header: for commands, the motion session they belong to


class JointPublisher:
    """Publishes JointStates of J fixed names and of fixed fields, in this order."""

    def __init__(
        self,
        node: Node,
        topic: str,
        names: Sequence[str],
        fields: Sequence[str],
        qos: QoSProfile,
    ) -> None:
        self._names, self._fields = names, fields
        self._pack = struct.Struct(f'<{len(names)}d').pack_into
        self._stamp = struct.Struct('<iI')
        self._node = node
        self._publisher = node.create_publisher(JointState, topic, qos)
        # By the handle, as its context manager costs as much as sending; counted where that is done
        # (EndoscopeNode.create_publisher).
        self._publish = vars(self._publisher).get('publish_raw') or (
            self._publisher.handle.publish_raw
        )
        self.count = 0
        self._session = ''
        self._lay_out()

    @property
    def session(self) -> str:
        """Frame of the messages: the motion session of commands."""
        return self._session

    @session.setter
    def session(self, name: str) -> None:
        """Name the session of the messages from now on."""
        if name != self._session:
            self._session = name
            self._lay_out()

    def _lay_out(self) -> None:
        n = len(self._names)
        zeros: dict[str, Any] = dict.fromkeys(self._fields, [0.0] * n)
        self._message = bytearray(
            encode_joint_state(self._names, 0, frame_id=self._session, **zeros)
        )
        columns = joint_state_layout(bytes(self._message)).columns
        starts = [columns[field][0] for field in QUANTITIES if field in self._fields]
        self._parts = [(start, slice(k * n, k * n + n)) for k, start in enumerate(starts)]

    def publish(self, stamp_ns: int, *values: float) -> None:
        """Publish one message: the J numbers of the first field, then those of the next."""
        seconds, nanoseconds = divmod(stamp_ns, _SECOND)
        self._stamp.pack_into(self._message, 4, seconds, nanoseconds)
        for start, part in self._parts:
            self._pack(self._message, start, *values[part])
        self._publish(bytes(self._message))
        self.count += 1

    def close(self) -> None:
        """Leave the topic to another sender."""
        self._node.destroy_publisher(self._publisher)


class JointReader:
    """Reads JointStates of certain joints out of CDR; if `exact` (for commands), no others."""

    def __init__(self, names: Sequence[str], exact: bool = False) -> None:
        self._names = tuple(names)
        self._exact = exact
        self._spans: list[tuple[int, int, bytes]] = [_NOT_LEARNT]
        self._struct = struct.Struct('<iI')
        self._slices: list[slice] = []
        self._pick: list[int] | None = None
        self._session = ''

    def read(self, data: bytes) -> JointSample:
        """Read one message."""
        if len(data) > LARGEST_BYTES:
            raise MalformedMessageError(f'has {len(data)} bytes; at most {LARGEST_BYTES} are read')
        for start, stop, expected in self._spans:
            if data[start:stop] != expected:
                self._learn(data)
                break
        values = self._struct.unpack_from(data, 4)
        fields = [values[part] for part in self._slices]
        if self._pick is not None:
            fields = [tuple(f[i] for i in self._pick) if f else f for f in fields]
        position, velocity, effort = fields
        stamp_ns = values[0] * _SECOND + values[1]
        return JointSample(stamp_ns, position, velocity, effort, self._session)

    def _learn(self, data: bytes) -> None:
        self._spans = [_NOT_LEARNT]
        layout = joint_state_layout(data)
        wrong = [n for n in self._names if n not in layout.names]
        if wrong or (self._exact and len(layout.names) != len(self._names)):
            raise MalformedMessageError(
                f'is for {", ".join(layout.names) or "no joint"} instead of '
                f'{", ".join(self._names)}'
            )
        self._session = layout.frame_id
        n = len(layout.names)
        present = [layout.columns[q][0] if q in layout.columns else None for q in QUANTITIES]
        starts = [start for start in present if start is not None]
        order = '>' if layout.big_endian else '<'
        body, at = _values_format(starts, n)
        self._struct = struct.Struct(f'{order}iI{at - _STAMP_END}x{body}')
        self._slices = []
        first = 2
        for start in present:
            self._slices.append(slice(first, first if start is None else first + n))
            first = self._slices[-1].stop
        order_here = [layout.names.index(name) for name in self._names]
        self._pick = None if order_here == list(range(n)) else order_here
        edges = [0, 4, _STAMP_END]
        for start in starts:
            edges += [start, start + 8 * n]
        edges.append(max(stop for _, stop in layout.fixed))
        gaps = [(a, max(a, b)) for a, b in zip(edges[0::2], edges[1::2], strict=True)]
        self._spans = [(a, b, data[a:b]) for a, b in gaps]


class JointSubscription:
    """Delivers the JointStates of a topic as samples; of other messages it tells the reason."""

    def __init__(
        self,
        node: Node,
        topic: str,
        names: Sequence[str],
        callback: Callable[[JointSample], None],
        qos: QoSProfile,
        *,
        exact: bool = False,
        on_malformed: Callable[[str], object] | None = None,
    ) -> None:
        self.malformed = 0  # messages that were unreadable or of other joints
        self._reader = JointReader(names, exact)
        self._callback = callback
        self._on_malformed = on_malformed
        self.subscription = node.create_subscription(
            JointState, topic, self._receive, qos, raw=True
        )

    def _receive(self, data: bytes) -> None:
        try:
            sample = self._reader.read(data)
        except MalformedMessageError as error:
            self.malformed += 1
            if self._on_malformed is not None:
                self._on_malformed(str(error))
            return
        self._callback(sample)


def _values_format(starts: Sequence[int], count: int) -> tuple[str, int]:
    """Format of all numbers from the first one on, and where that is."""
    if not starts:
        return '', _STAMP_END
    text = f'{count}d'
    for before, after in pairwise(starts):
        text += f'{after - before - 8 * count}x{count}d'
    return text, starts[0]


class RawSubscription:
    """Reads the messages of a topic as bytes, with both time stamps and the publication number.

    An executor that wakes up for every message costs eight times what it costs to empty the queue
    now and then, and does not tell the stamps. The middleware's queue, as deep as the QoS says, is
    read directly here, so the executor does not know of this subscription at all.
    """

    def __init__(self, node: Node, kind: type, topic: str, qos: QoSProfile) -> None:
        check_for_type_support(kind)
        self._kind = kind
        self.qos = qos
        with node.handle:
            self._handle = rclpy_implementation.Subscription(
                node.handle, kind, topic, qos.get_c_qos_profile()
            )
        self.topic: str = self._handle.get_topic_name()

    def take(self) -> list[tuple[bytes, dict[str, int]]]:
        """Return all waiting messages, each with the middleware's information on it."""
        taken = []
        take_one = self._handle.take_message
        kind = self._kind
        while (message := take_one(kind, True)) is not None:
            taken.append(message)
        return taken

    def count_publishers(self) -> int:
        """How many publishers are connected."""
        return int(self._handle.get_publisher_count())

    def close(self) -> None:
        """Leave the topic."""
        self._handle.destroy_when_not_in_use()
