"""Frames as the page of the console writes and reads them, apart from its server's code."""

import struct
from typing import NamedTuple

import numpy as np

from endoscope_console.teleop.frames import POINTS, InputFrame

_INPUT = struct.Struct('<BBHIIIdff')
_HEAD = struct.Struct('<BBHIdd')


class Picture(NamedTuple):
    """A telemetry frame: times in s, ranges (N, 3), and two polylines (`POINTS`, 3) in m."""

    seq: int
    stamp_s: float
    age_s: float
    ranges: np.ndarray
    wanted: np.ndarray
    actual: np.ndarray


def encode_input(frame: InputFrame) -> bytes:
    """Write an input frame, 32 bytes: kind, flags, source, seq, grip, seen, t, x, y."""
    flags = frame.pressed, frame.turbo, frame.visible, frame.focused, frame.position_mode
    numbers = frame.source, frame.seq, frame.grip, frame.seen, frame.t, frame.x, frame.y
    return _INPUT.pack(2, sum(flag << k for k, flag in enumerate(flags)), *numbers)


def decode_telemetry(data: bytes) -> Picture:
    """Read a telemetry frame; ValueError where it is none."""
    kind, version, count, seq, stamp_s, age_s = _HEAD.unpack_from(data)
    numbers = np.frombuffer(data, '<f4', offset=_HEAD.size)
    if (kind, version, len(numbers)) != (1, 1, 3 * count + 6 * POINTS):
        raise ValueError(f'no telemetry frame: {kind}, {version}, {len(numbers)} numbers')
    ranges, wanted, actual = np.split(numbers.reshape(-1, 3), (count, count + POINTS))
    return Picture(seq, stamp_s, age_s, ranges, wanted, actual)
