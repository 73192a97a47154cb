"""Where the fields of one CDR message lie, so that equal messages decode as one array."""

import struct
from dataclasses import dataclass

from endoscope_bags.errors import MalformedMessageError

QUANTITIES = ('position', 'velocity', 'effort')


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
