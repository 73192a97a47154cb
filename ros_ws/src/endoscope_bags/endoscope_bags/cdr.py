"""Messages to CDR bytes and back without ROS, many at once.

What is written equals, up to trailing padding, what `rosbags` and rmw_fastrtps write: little endian
XCDR1 (OMG CDR), 4-byte encapsulation header, alignment counted after it. What is read of one topic
nearly always differs in its numbers only: messages are grouped by size and `Layout`, and each group
becomes one byte matrix out of which the numbers are cut.
"""

import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from endoscope_bags.errors import MalformedMessageError
from endoscope_bags.message_types import STRING, typestore

_LITTLE_ENDIAN = b'\x00\x01\x00\x00'
_NANOSECONDS = 1_000_000_000
_STAMP = struct.Struct('<iI')
_POSE = struct.Struct('<7d')
QUANTITIES = ('position', 'velocity', 'effort')
HEAD_WITH_STAMP = 12
"""Bytes of encapsulation and stamp."""
# A topic with more layouts than this (a counter in a string, say) is decoded one by one.
_LAYOUTS_WORTH_COMPARING = 64
# One by one a message takes about 20 us and 1 kB: these take 10 s and half a gigabyte.
_MOST_LAYOUTS = 1 << 19


def encode_joint_states(
    names: Sequence[str],
    stamp_ns: npt.ArrayLike,
    *,
    position: npt.ArrayLike | None = None,
    velocity: npt.ArrayLike | None = None,
    effort: npt.ArrayLike | None = None,
    frame_id: str = '',
) -> list[bytes]:
    """Encode N JointStates: stamps in ns since the epoch, (N, J) in rad, rad/s, N m (wires: N)."""
    stamps = _checked_stamps(stamp_ns)
    shape = (len(stamps), len(names))
    prefix = bytearray(_LITTLE_ENDIAN + bytes(8))
    _append_string(prefix, frame_id)
    _append_count(prefix, len(names))
    for name in names:
        _append_string(prefix, name)
    columns: list[tuple[int, npt.NDArray[np.float64]]] = []
    for quantity, values in (('position', position), ('velocity', velocity), ('effort', effort)):
        if values is None or not names:
            _append_count(prefix, 0)
            continue
        array = np.asarray(values, dtype=np.float64)
        if array.shape != shape:
            raise MalformedMessageError(
                f'JointState {quantity}: shape {array.shape} where {shape} (stamps, names) is due'
            )
        _append_count(prefix, len(names))
        _align(prefix, 8)
        columns.append((len(prefix), array))
        prefix += bytes(8 * len(names))
    return _filled(prefix, stamps, columns)


def encode_joint_state(
    names: Sequence[str],
    stamp_ns: int,
    *,
    position: Sequence[float] | None = None,
    velocity: Sequence[float] | None = None,
    effort: Sequence[float] | None = None,
    frame_id: str = '',
) -> bytes:
    """Encode one JointState; arguments as in `encode_joint_states`, shapes (J,)."""
    row = {
        key: None if values is None else [values]
        for key, values in (('position', position), ('velocity', velocity), ('effort', effort))
    }
    return encode_joint_states(names, [stamp_ns], frame_id=frame_id, **row)[0]


def encode_poses(
    stamp_ns: npt.ArrayLike,
    position: npt.ArrayLike,
    orientation: npt.ArrayLike,
    *,
    frame_id: str = '',
) -> list[bytes]:
    """Encode N PoseStamped: ns since the epoch, (N, 3) in m, (N, 4) unit quaternions x, y, z, w."""
    stamps = _checked_stamps(stamp_ns)
    parts = (np.asarray(position, dtype=np.float64), np.asarray(orientation, dtype=np.float64))
    if parts[0].shape != (len(stamps), 3) or parts[1].shape != (len(stamps), 4):
        raise MalformedMessageError(
            f'PoseStamped: shapes {parts[0].shape} and {parts[1].shape} where '
            f'({len(stamps)}, 3) and ({len(stamps)}, 4) are due'
        )
    prefix = bytearray(_LITTLE_ENDIAN + bytes(8))
    _append_string(prefix, frame_id)
    _align(prefix, 8)
    start = len(prefix)
    prefix += bytes(56)
    return _filled(prefix, stamps, [(start, np.hstack(parts))])


class TransformEncoder:
    """Writes `tf2_msgs/msg/TFMessage` about the same N frames (parent, child) again and again."""

    def __init__(self, frames: Sequence[tuple[str, str]]) -> None:
        self._message = bytearray(_LITTLE_ENDIAN)
        self._places: list[tuple[int, int]] = []
        _append_count(self._message, len(frames))
        for parent, child in frames:
            stamp = len(self._message)
            self._message += bytes(8)
            _append_string(self._message, parent)
            _append_string(self._message, child)
            _align(self._message, 8)
            self._places.append((stamp, len(self._message)))
            self._message += bytes(56)

    def encode(
        self, stamp_ns: int, poses: Sequence[tuple[Sequence[float], Sequence[float]]]
    ) -> bytes:
        """Write one message; poses, in the parent: (3,) in m, (4,) unit quaternion x, y, z, w."""
        stamp = divmod(stamp_ns, _NANOSECONDS)
        for (at, values), (translation, rotation) in zip(self._places, poses, strict=True):
            _STAMP.pack_into(self._message, at, *stamp)
            _POSE.pack_into(self._message, values, *translation, *rotation)
        return bytes(self._message)


def encode_clock(time_ns: int) -> bytes:
    """Encode one `rosgraph_msgs/msg/Clock`, `time_ns` in ns."""
    return _LITTLE_ENDIAN + _STAMP.pack(*divmod(time_ns, _NANOSECONDS))


def encode_string(text: str) -> bytes:
    """Encode one `std_msgs/msg/String`."""
    return serialise(STRING, typestore().types[STRING](data=text))


def serialise(type_name: str, message: Any) -> bytes:
    """Encode any message object of `message_types.typestore()`."""
    return bytes(typestore().serialize_cdr(message, type_name))


def _checked_stamps(stamp_ns: npt.ArrayLike) -> npt.NDArray[np.int64]:
    stamps = np.atleast_1d(np.asarray(stamp_ns))
    if stamps.ndim != 1 or not np.issubdtype(stamps.dtype, np.integer):
        raise MalformedMessageError('stamps: integers in ns of shape (N,) are due')
    stamps = stamps.astype(np.int64)
    seconds = stamps // _NANOSECONDS
    if stamps.size and (seconds.min() < -(2**31) or seconds.max() >= 2**31):
        raise MalformedMessageError(
            'stamps: seconds outside the 32 bits of builtin_interfaces/Time'
        )
    return stamps


def _filled(
    template: bytearray,
    stamps: npt.NDArray[np.int64],
    columns: list[tuple[int, npt.NDArray[np.float64]]],
) -> list[bytes]:
    size = len(template)
    rows = np.tile(np.frombuffer(bytes(template), dtype=np.uint8), (len(stamps), 1))
    seconds = (stamps // _NANOSECONDS).astype('<i4')
    nanoseconds = (stamps % _NANOSECONDS).astype('<u4')
    rows[:, 4:8] = seconds.view(np.uint8).reshape(-1, 4)
    rows[:, 8:12] = nanoseconds.view(np.uint8).reshape(-1, 4)
    for start, values in columns:
        width = 8 * values.shape[1]
        raw = np.ascontiguousarray(values, dtype='<f8').view(np.uint8).reshape(-1, width)
        rows[:, start : start + width] = raw
    blob = rows.tobytes()
    return [blob[k : k + size] for k in range(0, len(blob), size)]


def _align(buffer: bytearray, size: int) -> None:
    buffer += bytes(-(len(buffer) - 4) % size)


def _append_count(buffer: bytearray, count: int) -> None:
    _align(buffer, 4)
    buffer += struct.pack('<I', count)


def _append_string(buffer: bytearray, text: str) -> None:
    encoded = text.encode() + b'\x00'
    _append_count(buffer, len(encoded))
    buffer += encoded


@dataclass(frozen=True)
class Layout:
    """Fields of one message as offsets into its bytes."""

    big_endian: bool
    frame_id: str
    names: tuple[str, ...]  # of the joints; empty for a pose
    # For each quantity that the message has, the offset of its doubles and their number.
    columns: dict[str, tuple[int, int]]
    # Spans (start, stop) that have to be equal in another message for this layout to hold there
    # too: everything but the stamp, the numbers and the padding.
    fixed: tuple[tuple[int, int], ...]


class _Cursor:
    """Walks over the fields of a message and notes what makes its layout."""

    def __init__(self, data: bytes) -> None:
        if len(data) < 4 or data[:2] not in (b'\x00\x00', b'\x00\x01'):
            raise MalformedMessageError(f'not plain CDR: begins with {data[:4].hex() or "nothing"}')
        self.data = data
        self.big_endian = data[1] == 0
        self.fixed: list[tuple[int, int]] = [(0, 2)]
        self._count = struct.Struct('>I' if self.big_endian else '<I')
        self._position = 4

    def skip(self, size: int, alignment: int) -> int:
        start = self._position + (-(self._position - 4) % alignment)
        if start + size > len(self.data):
            raise MalformedMessageError(
                f'ends after {len(self.data)} bytes where a field reaches to {start + size}'
            )
        self._position = start + size
        return start

    def count(self) -> int:
        start = self.skip(4, 4)
        self.fixed.append((start, start + 4))
        return int(self._count.unpack_from(self.data, start)[0])

    def string(self) -> str:
        size = self.count()
        start = self.skip(size, 1)
        self.fixed.append((start, start + size))
        try:
            return self.data[start : start + size].rstrip(b'\x00').decode()
        except UnicodeDecodeError as error:
            raise MalformedMessageError('holds a string that is not UTF-8') from error

    def doubles(self, count: int) -> int:
        return self.skip(8 * count, 8)


def joint_state_layout(data: bytes) -> Layout:
    """Find the fields of a `sensor_msgs/msg/JointState`."""
    cursor = _Cursor(data)
    cursor.skip(8, 4)
    frame_id = cursor.string()
    n_names = cursor.count()
    if 5 * n_names > len(data):
        raise MalformedMessageError(f'claims {n_names} names in {len(data)} bytes')
    names = tuple(cursor.string() for _ in range(n_names))
    if len(set(names)) != len(names):
        raise MalformedMessageError(f'names a joint twice: {", ".join(names)}')
    columns = {}
    for quantity in QUANTITIES:
        count = cursor.count()
        if not count:
            continue
        if count != n_names:
            raise MalformedMessageError(f'has {count} values of {quantity} for {n_names} names')
        columns[quantity] = (cursor.doubles(count), count)
    return Layout(cursor.big_endian, frame_id, names, columns, tuple(cursor.fixed))


def pose_layout(data: bytes) -> Layout:
    """Find the fields of a `geometry_msgs/msg/PoseStamped`: columns position and orientation."""
    cursor = _Cursor(data)
    cursor.skip(8, 4)
    frame_id = cursor.string()
    columns = {'position': (cursor.doubles(3), 3), 'orientation': (cursor.doubles(4), 4)}
    return Layout(cursor.big_endian, frame_id, (), columns, tuple(cursor.fixed))


@dataclass(frozen=True)
class Payloads:
    """The bytes of N messages, one after another in `data`."""

    data: bytes | bytearray
    start: npt.NDArray[np.int64]  # (N,), where each begins in `data`
    size: npt.NDArray[np.int64]  # (N,), in bytes

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, index: int) -> bytes:
        first = int(self.start[index])
        return bytes(self.data[first : first + int(self.size[index])])

    def matrix(self, rows: npt.NDArray[np.int64]) -> npt.NDArray[np.uint8]:
        """Return messages of equal size as a matrix, shape (len(rows), size)."""
        size = int(self.size[rows[0]])
        windows = np.lib.stride_tricks.sliding_window_view(
            np.frombuffer(self.data, dtype=np.uint8), size
        )
        return windows[self.start[rows]]


def stamps_of_heads(data: bytes, start: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Header stamps (N,) in ns; from each `start` (N,), `HEAD_WITH_STAMP` bytes are there."""
    bytes_ = np.frombuffer(data, dtype=np.uint8)
    field = bytes_[start[:, None] + np.arange(4, HEAD_WITH_STAMP)]
    big = bytes_[start + 1] == 0
    return np.where(big, _stamps(field, '>'), _stamps(field, '<'))


@dataclass(frozen=True)
class LayoutGroup:
    """M messages of one layout."""

    rows: npt.NDArray[np.int64]  # (M,), ascending, indices among all messages
    layout: Layout
    matrix: npt.NDArray[np.uint8]  # (M, size), their bytes

    def stamp_ns(self) -> npt.NDArray[np.int64]:
        """Return the header stamps in ns, shape (M,)."""
        return _stamps(self._field(4, 8), '>' if self.layout.big_endian else '<')

    def column(self, quantity: str) -> npt.NDArray[np.float64] | None:
        """Return the numbers of a quantity, shape (M, count), or None where it is empty."""
        if quantity not in self.layout.columns:
            return None
        start, count = self.layout.columns[quantity]
        order = '>' if self.layout.big_endian else '<'
        return self._field(start, 8 * count).view(order + 'f8').astype(np.float64)

    def _field(self, start: int, size: int) -> npt.NDArray[np.uint8]:
        return np.ascontiguousarray(self.matrix[:, start : start + size])


def _stamps(field: npt.NDArray[np.uint8], order: str) -> npt.NDArray[np.int64]:
    stamp = field.view([('sec', order + 'i4'), ('nanosec', order + 'u4')])[:, 0]
    total: npt.NDArray[np.int64] = stamp['sec'].astype(np.int64) * _NANOSECONDS + stamp['nanosec']
    return total


def grouped_by_layout(
    payloads: Payloads, find_layout: Callable[[bytes], Layout]
) -> Iterator[LayoutGroup]:
    """Split messages into groups of equal layout; errors count the messages from 1."""
    for size in np.unique(payloads.size):
        rows = np.flatnonzero(payloads.size == size)
        matrix = payloads.matrix(rows)
        n_layouts = 0
        while len(rows):
            n_layouts += 1
            if n_layouts > _MOST_LAYOUTS:
                raise MalformedMessageError(
                    f'message {int(rows[0]) + 1} has yet another layout: too many'
                )
            try:
                layout = find_layout(payloads[int(rows[0])])
            except MalformedMessageError as error:
                raise MalformedMessageError(f'message {int(rows[0]) + 1} {error}') from error
            if n_layouts > _LAYOUTS_WORTH_COMPARING:
                yield LayoutGroup(rows[:1], layout, matrix[:1])
                rows, matrix = rows[1:], matrix[1:]
                continue
            columns = np.concatenate([np.arange(*span) for span in layout.fixed])
            same = (matrix[:, columns] == matrix[0, columns]).all(axis=1)
            yield LayoutGroup(rows[same], layout, matrix[same])
            rows, matrix = rows[~same], matrix[~same]
