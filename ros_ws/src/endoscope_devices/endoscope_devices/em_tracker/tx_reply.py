"""Reads the reply to TX: where each tool is, in text (Aurora API Guide, command TX, option 0001).

``NN`` handles, for each ``HH`` and either ``MISSING``, ``DISABLED``, ``UNOCCUPIED`` or the
transformation (quaternion q0 qx qy qz with 4 decimals implied, position in mm with 2, error in mm
with 4), then port status and frame number in hexadecimal and a line feed; at the end the system
status.  TX rather than BX: text can be checked digit by digit, and ends where it ends; of BX one
would wait for the bytes that a flipped length byte announces.
"""

import math
import re
from dataclasses import dataclass
from enum import IntFlag

_COUNT = re.compile(r'[0-9A-F]{2}')
_TOOL = re.compile(
    r'(?P<handle>[0-9A-F]{2})'
    r'(?:(?P<state>UNOCCUPIED|DISABLED)(?:[0-9A-F]{16})?'
    r'|(?:MISSING|(?P<q>(?:[+-]\d{5}){4})(?P<t>(?:[+-]\d{6}){3})(?P<e>[+-]\d{5}))'
    r'(?P<status>[0-9A-F]{8})(?P<frame>[0-9A-F]{8}))\n'
)
_SYSTEM = re.compile(r'[0-9A-F]{4}')
_LARGEST_M = 2.0
_NORM_TOLERANCE = 1e-3


class PortStatus(IntFlag):
    """Bits of the port status (Aurora API Guide, commands BX and TX)."""

    OCCUPIED = 1 << 0
    INITIALIZED = 1 << 4
    ENABLED = 1 << 5
    OUT_OF_VOLUME = 1 << 6
    PARTIALLY_OUT_OF_VOLUME = 1 << 7
    SENSOR_BROKEN = 1 << 8
    PROCESSING_EXCEPTION = 1 << 12


@dataclass(frozen=True)
class ToolReading:
    """One tool in one frame."""

    handle: int  # of the port, like `status`
    status: PortStatus
    frame: int
    # In m, (3,), in the frame of the field generator; empty where the sensor is missing.
    position: tuple[float, ...] = ()
    orientation: tuple[float, ...] = ()  # unit quaternion x, y, z, w, likewise
    error: float = math.nan  # the tracker's own estimate in m


class MalformedReplyError(ValueError):
    """Text that is no reply to TX."""


def parse_tx(text: str) -> list[ToolReading]:
    """Tools of a reply without CRC and carriage return, but for those disabled or unplugged.

    MalformedReplyError where a character is not where it belongs, or a number cannot be.
    """
    count = _COUNT.match(text)
    if count is None:
        raise MalformedReplyError('no number of handles')
    at = 2
    tools = []
    for _ in range(int(count.group(), 16)):
        match = _TOOL.match(text, at)
        if match is None:
            raise MalformedReplyError(f'no tool at character {at}')
        at = match.end()
        if not match['state']:
            tools.append(_tool(match))
    if not _SYSTEM.fullmatch(text, at):
        raise MalformedReplyError(f'no system status at character {at}')
    return tools


def _tool(match: re.Match[str]) -> ToolReading:
    handle, status, frame = (int(match[key], 16) for key in ('handle', 'status', 'frame'))
    if not match['q']:
        return ToolReading(handle, PortStatus(status), frame)
    w, x, y, z = _numbers(match['q'], 6, 1e-4)
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if abs(norm - 1.0) > _NORM_TOLERANCE:
        raise MalformedReplyError(f'a quaternion of length {norm:.4f}')
    position = _numbers(match['t'], 7, 1e-5)
    if max(abs(v) for v in position) > _LARGEST_M:
        raise MalformedReplyError(f'a sensor at {position} m')
    return ToolReading(
        handle,
        PortStatus(status),
        frame,
        position,
        (x / norm, y / norm, z / norm, w / norm),
        int(match['e']) * 1e-7,
    )


def _numbers(digits: str, width: int, unit: float) -> tuple[float, ...]:
    return tuple(int(digits[k : k + width]) * unit for k in range(0, len(digits), width))
