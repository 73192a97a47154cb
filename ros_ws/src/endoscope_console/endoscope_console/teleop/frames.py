"""Frames between a page and its server, little-endian: what a hand does, and what it is shown."""

import math
import struct
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from endoscope_core.errors import EndoscopeError

TELEMETRY, INPUT = 1, 2
VERSION = 1
POINTS = 40
"""Of a polyline in a telemetry frame."""

_INPUT = struct.Struct('<BBHIIIdff')
_HEAD = struct.Struct('<BBHIdd')
_FLAGS = 1, 2, 4, 8, 16
"""Of the first five fields of an input frame."""
_KNOWN_FLAGS = sum(_FLAGS)
# 300 years: more is no valid time, and a float does not resolve such a number of ns.
_LAST_S = 1e10
_F32 = np.dtype('<f4')


class MalformedFrameError(EndoscopeError, ValueError):
    """A frame that is not one; the message says what is wrong with it."""


class InputDevice(IntEnum):
    """Input device of a frame."""

    KEYBOARD = 0
    POINTER = 1
    GAMEPAD = 2


@dataclass(frozen=True)
class InputFrame:
    """What the operator's hand does now."""

    pressed: bool  # whether the dead-man is held
    turbo: bool  # whether by its fast button
    visible: bool  # whether the page is shown
    focused: bool  # whether the page has the keyboard
    position_mode: bool  # whether `x` and `y` are angles and not speeds
    # One of `InputDevice`. The frame that ends a grip names the source of the grip; where it names
    # another, the device of the grip is gone.
    source: int
    seq: int  # number of the frame, counting up
    grip: int  # larger for every new one; without meaning while nothing is pressed
    seen: int  # number of the newest picture that was drawn
    t: float  # steady time of the page in s
    x: float  # deflection, like `y`, -1 to 1; in position mode rad since the grip began
    y: float


def decode_input(data: bytes) -> InputFrame:
    """Read an input frame that came from a page; MalformedFrameError where anything is unknown."""
    if len(data) != _INPUT.size:
        raise MalformedFrameError(f'an input frame has {_INPUT.size} bytes, not {len(data)}')
    kind, flags, source, seq, grip, seen, t, x, y = _INPUT.unpack(data)
    if kind != INPUT:
        raise MalformedFrameError(f'an input frame is of kind {INPUT}, not {kind}')
    if flags & ~_KNOWN_FLAGS:
        raise MalformedFrameError(f'an input frame has no flags {flags & ~_KNOWN_FLAGS:#x}')
    if source not in tuple(InputDevice):
        raise MalformedFrameError(f'a page has no source {source}')
    if not (abs(t) <= _LAST_S and math.isfinite(x) and math.isfinite(y)):
        raise MalformedFrameError(f'no time in s and two angles: {t}, {x}, {y}')
    pressed, turbo, visible, focused, position_mode = (bool(flags & flag) for flag in _FLAGS)
    return InputFrame(
        *(pressed, turbo, visible, focused, position_mode), source, seq, grip, seen, t, x, y
    )


def encode_telemetry(
    seq: int,
    stamp_s: float,
    age_s: float,
    ranges: ArrayLike,
    wanted: ArrayLike,
    actual: ArrayLike,
) -> bytes:
    """Write one picture of the slave: stamp and age in s, ranges (N, 3), two polylines in m.

    `ranges` are the smallest, largest and last value of each signal since the frame before; the
    (`POINTS`, 3) the section as commanded and as measured. NaN where nothing is known.
    """
    of_signals, *lines = (np.asarray(array, dtype=_F32) for array in (ranges, wanted, actual))
    if of_signals.ndim != 2 or of_signals.shape[1] != 3:
        raise ValueError(f'ranges have shape (N, 3), not {of_signals.shape}')
    for line in lines:
        if line.shape != (POINTS, 3):
            raise ValueError(f'a polyline has shape ({POINTS}, 3), not {line.shape}')
    head = _HEAD.pack(TELEMETRY, VERSION, len(of_signals), seq, stamp_s, age_s)
    return b''.join((head, of_signals.tobytes(), *(line.tobytes() for line in lines)))
