"""Ring buffer of the last messages of all topics, bounded in age and size, with latched ones.

A thousand ticks a second leave some 90 000 messages in 20 s. As objects they would be walked over
by each garbage collection and take three times their size, so those that came together are one
piece of bytes.
"""

import struct
from collections import deque
from collections.abc import Collection, Iterator, Sequence

from endoscope_bags.recording_session import Arrival

_HEAD = struct.Struct('<qHIqI')
_SECOND = 1_000_000_000


def packed(batch: Sequence[Arrival]) -> bytes:
    """Serialise arrivals into one piece of bytes."""
    pack = _HEAD.pack
    return b''.join(
        [
            part
            for received_ns, topic, sequence, published_ns, data in batch
            for part in (
                pack(received_ns, topic, sequence & 0xFFFFFFFF, published_ns, len(data)),
                data,
            )
        ]
    )


def unpacked(piece: bytes) -> Iterator[Arrival]:
    """Return the arrivals that `packed` serialised."""
    place = 0
    while place < len(piece):
        received_ns, topic, sequence, published_ns, size = _HEAD.unpack_from(piece, place)
        place += _HEAD.size
        yield Arrival(received_ns, topic, sequence, published_ns, piece[place : place + size])
        place += size


class RecentMessages:
    """Messages of the last `seconds`, of at most `capacity` bytes with those that were in force.

    Of a topic whose last message holds until the next one, the last before these is kept too; with
    0 seconds nothing else is.
    """

    def __init__(self, seconds: float, capacity: int) -> None:
        self.size = 0  # bytes, never more than the capacity
        self.left_out = 0  # messages that alone are larger than the capacity
        self._age_ns = round(seconds * _SECOND)
        self._capacity = capacity
        # When the last of them came, all of them, and those among them that hold until the next.
        self._pieces: deque[tuple[int, bytes, tuple[Arrival, ...]]] = deque()
        self._before: dict[int, Arrival] = {}  # by topic, from before all pieces

    def add(self, batch: Sequence[Arrival], holding: Collection[int], now_ns: int) -> None:
        """Keep arrivals; topics `holding` are those whose last message holds until the next."""
        self._forget(now_ns - self._age_ns)
        if not batch:
            return
        held = tuple(arrival for arrival in batch if arrival.topic in holding)
        if not self._age_ns:
            self._hold(held)
            return
        piece = packed(batch)
        size = len(piece) + sum(len(arrival.data) for arrival in held)
        if size > self._capacity:
            if len(batch) == 1:
                self.left_out += 1
                return
            for arrival in batch:
                self.add([arrival], holding, now_ns)
            return
        self._pieces.append((max(arrival.received_ns for arrival in batch), piece, held))
        self.size += size
        while self.size > self._capacity:
            if len(self._pieces) > 1:
                self._drop_first()
            else:
                self.size -= len(self._before.pop(next(iter(self._before))).data)

    def _forget(self, before_ns: int) -> None:
        while self._pieces and self._pieces[0][0] < before_ns:
            self._drop_first()

    def _drop_first(self) -> None:
        _, piece, held = self._pieces.popleft()
        self.size -= len(piece) + sum(len(arrival.data) for arrival in held)
        self._hold(held)

    def _hold(self, held: Sequence[Arrival]) -> None:
        for arrival in held:
            older = self._before.get(arrival.topic)
            self.size += len(arrival.data) - (0 if older is None else len(older.data))
            self._before[arrival.topic] = arrival

    @property
    def seconds(self) -> float:
        """From the first to the last of the messages, in s."""
        if not self._pieces:
            return 0.0
        return (self._pieces[-1][0] - self._pieces[0][0]) / _SECOND

    @property
    def pieces(self) -> list[bytes]:
        """All messages, as `unpacked` reads them, oldest first."""
        return [piece for _, piece, _ in self._pieces]

    @property
    def in_force_before(self) -> list[Arrival]:
        """Of each topic that holds, the last message before the oldest of the pieces."""
        return list(self._before.values())

    @property
    def in_force(self) -> list[Arrival]:
        """Of each topic that holds, the last message of all."""
        newest = dict(self._before)
        for _, _, held in self._pieces:
            newest |= {arrival.topic: arrival for arrival in held}
        return list(newest.values())
