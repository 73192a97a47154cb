"""Messages to CDR bytes without ROS: whole series at once where the project writes many.

The bytes equal those of `rosbags`' serialiser and of rmw_fastrtps up to trailing padding: little
endian XCDR1 (OMG CDR), 4-byte encapsulation header, alignment counted after it.
"""

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from endoscope_bags.errors import MalformedMessageError
from endoscope_bags.message_types import STRING, typestore

_LITTLE_ENDIAN = b'\x00\x01\x00\x00'
_NANOSECONDS = 1_000_000_000
_STAMP = struct.Struct('<iI')
_POSE = struct.Struct('<7d')


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
