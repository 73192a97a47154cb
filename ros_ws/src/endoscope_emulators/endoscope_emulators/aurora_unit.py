"""Replies of an Aurora to commands, by NDI's Aurora Application Program Interface Guide.

Names of commands, replies and errors below are those of the guide's command reference (INIT, COMM,
PHSR, PHINF, PINIT, PENA, PDIS, PHF, TSTART, TSTOP, BX, TX, VER, APIREV, GETINFO, ECHO, BEEP, LED,
RESET) and of its tables of error codes and of port status bits.
"""

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum, auto

from endoscope_devices.em_tracker.aurora_port import crc16
from endoscope_devices.em_tracker.tx_reply import PortStatus

BAUD_RATES = (9600, 14400, 19200, 38400, 57600, 115200, 921600, 1228739)
FRAME_RATE = 40.0

_FIRST_HANDLE = 0x0A
_TRANSFORMS = 0x0001
_NOT_NORMALLY_REPORTED = 0x0800
_FIRMWARE = 'AURORA Rev 012'


@dataclass(frozen=True)
class SensorView:
    """Where a sensor is."""

    position: Sequence[float] = (0.0, 0.0, -0.2)  # m, (3,), in the frame of the field generator
    orientation: Sequence[float] = (0.0, 0.0, 0.0, 1.0)  # unit quaternion x, y, z, w
    error: float = 0.0003  # indicated, in m
    out_of_volume: bool = False  # whether the measurement volume ends before it
    broken: bool = False  # whether a coil of the sensor is broken: then there is no position


# Sensor at a time in s since frame 0; None where the field is too weak to see it at all.
SensorSource = Callable[[float], SensorView | None]


class _Mode(Enum):
    RESET = auto()
    SETUP = auto()
    TRACKING = auto()


class _Refusal(Exception):
    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


# Error codes of the guide.
_INVALID_COMMAND = 0x01
_WRONG_CRC = 0x04
_BAD_COMM = 0x06
_WRONG_PARAMETERS = 0x07
_INVALID_HANDLE = 0x08
_INVALID_PRIORITY = 0x09
_WRONG_MODE = 0x0C
_NOT_INITIALIZED = 0x0E
_SYSTEM_NOT_INITIALIZED = 0x10
_OUT_OF_RANGE = 0x23


@dataclass
class _Port:
    source: SensorSource
    initialized: bool = False
    enabled: bool = False

    @property
    def status(self) -> PortStatus:
        status = PortStatus.OCCUPIED
        if self.initialized:
            status |= PortStatus.INITIALIZED
        if self.enabled:
            status |= PortStatus.ENABLED
        return status


@dataclass
class _Frame:
    number: int = -1
    views: dict[int, SensorView | None] = field(default_factory=dict)


class AuroraUnit:
    """The tracker without its line; a wired sensor each in ports 1, 2, ..."""

    def __init__(
        self, sources: Sequence[SensorSource], now: Callable[[], float], latency: float = 0.0
    ) -> None:
        self._sources = tuple(sources)
        self.now = now  # monotonic time in s
        self._latency = latency  # s from measuring a frame to having it ready
        self._ports: dict[int, _Port] = {}
        self._mode = _Mode.RESET
        self.frame_zero = now()  # when frame 0 was, in s
        self._frame = _Frame()
        self.baud = BAUD_RATES[0]  # rate that it listens at

    def reset(self) -> bytes:
        """Restart, as after power-up, a serial break or RESET; returns its message."""
        self._mode = _Mode.RESET
        self._ports = {}
        self.frame_zero = self.now()
        self.baud = BAUD_RATES[0]
        return sealed('RESET')

    def answer(self, line: bytes) -> bytes:
        """Reply to ``NAME:parametersCRC`` or ``NAME parameters`` without its carriage return."""
        try:
            name, parameters = self._taken_apart(line)
            handler = getattr(self, f'_on_{name.lower()}', None)
            if handler is None or not name.isalnum():
                raise _Refusal(_INVALID_COMMAND)
            reply = handler(parameters)
        except _Refusal as refusal:
            return sealed(f'ERROR{refusal.code:02X}')
        return reply if isinstance(reply, bytes) else sealed(reply)

    @staticmethod
    def _taken_apart(line: bytes) -> tuple[str, str]:
        text = line.decode('latin-1')
        name, colon, rest = text.partition(':')
        if colon:
            if len(rest) < 4 or rest[-4:] != f'{crc16(line[:-4]):04X}':
                raise _Refusal(_WRONG_CRC)
            return name, rest[:-4]
        name, _, rest = text.partition(' ')
        return name, rest

    def _need(self, *modes: _Mode) -> None:
        if self._mode is _Mode.RESET:
            raise _Refusal(_SYSTEM_NOT_INITIALIZED)
        if self._mode not in modes:
            raise _Refusal(_WRONG_MODE)

    def _port(self, parameters: str) -> _Port:
        port = self._ports.get(_hexadecimal(parameters[:2]))
        if port is None:
            raise _Refusal(_INVALID_HANDLE)
        return port

    def _on_init(self, _: str) -> str:
        self._mode = _Mode.SETUP
        self._ports = {_FIRST_HANDLE + k: _Port(source) for k, source in enumerate(self._sources)}
        return 'OKAY'

    def _on_reset(self, _: str) -> bytes:
        return self.reset()

    def _on_comm(self, parameters: str) -> str:
        if len(parameters) != 5 or parameters[1:] != '0000' or parameters[0] not in '01234567':
            raise _Refusal(_BAD_COMM)
        self.baud = BAUD_RATES[int(parameters[0])]
        return 'OKAY'

    def _on_apirev(self, _: str) -> str:
        return 'D.001.007'

    def _on_ver(self, _: str) -> str:
        return (
            'AURORA Control Firmware\nNDI S/N: A5-00000\nCharacterization Date: 01/01/15\n'
            f'Freeze Tag: {_FIRMWARE}\nFreeze Date: 03/13/15\n(C) Northern Digital Inc.\n'
        )

    def _on_getinfo(self, parameters: str) -> str:
        if parameters != 'Features.Firmware.Version':
            raise _Refusal(_OUT_OF_RANGE)
        return f'{parameters}=012.000.000;3;1;0;16;;Current firmware revision number'

    def _on_echo(self, parameters: str) -> str:
        return parameters

    def _on_beep(self, parameters: str) -> str:
        if parameters not in tuple('123456789'):
            raise _Refusal(_OUT_OF_RANGE)
        return '1'

    def _on_led(self, parameters: str) -> str:
        self._port(parameters)
        return 'OKAY'

    def _on_phsr(self, parameters: str) -> str:
        self._need(_Mode.SETUP, _Mode.TRACKING)
        wanted: dict[str, Callable[[_Port], bool]] = {
            '': lambda _: True,
            '00': lambda _: True,
            '01': lambda _: False,
            '02': lambda port: not port.initialized,
            '03': lambda port: port.initialized and not port.enabled,
            '04': lambda port: port.enabled,
        }
        if parameters not in wanted:
            raise _Refusal(_OUT_OF_RANGE)
        listed = [(h, p) for h, p in self._ports.items() if wanted[parameters](p)]
        return f'{len(listed):02X}' + ''.join(f'{h:02X}{p.status:03X}' for h, p in listed)

    def _on_phinf(self, parameters: str) -> str:
        self._need(_Mode.SETUP, _Mode.TRACKING)
        port = self._port(parameters)
        options = _hexadecimal(parameters[2:] or '0001')
        number = list(self._ports.values()).index(port) + 1
        parts = (
            (0x0001, f'02000000NDI         001{number:08X}{port.status & 0xFF:02X}'),
            (0x0004, f'{"610066":<20}'),
            (0x0008, '00'),
            (0x0010, '00'),
            (0x0020, f'{"":10}0{number}00'),
        )
        if options & ~sum(bit for bit, _ in parts):
            raise _Refusal(_OUT_OF_RANGE)
        return ''.join(text for bit, text in parts if options & bit)

    def _on_pinit(self, parameters: str) -> str:
        self._need(_Mode.SETUP)
        self._port(parameters).initialized = True
        return 'OKAY'

    def _on_pena(self, parameters: str) -> str:
        self._need(_Mode.SETUP)
        port = self._port(parameters)
        if parameters[2:] not in ('S', 'D', 'B'):
            raise _Refusal(_INVALID_PRIORITY)
        if not port.initialized:
            raise _Refusal(_NOT_INITIALIZED)
        port.enabled = True
        return 'OKAY'

    def _on_pdis(self, parameters: str) -> str:
        self._need(_Mode.SETUP)
        self._port(parameters).enabled = False
        return 'OKAY'

    def _on_phf(self, parameters: str) -> str:
        self._need(_Mode.SETUP)
        self._port(parameters)
        del self._ports[_hexadecimal(parameters)]
        return 'OKAY'

    def _on_tstart(self, parameters: str) -> str:
        self._need(_Mode.SETUP)
        if parameters not in ('', '40', '80'):
            raise _Refusal(_OUT_OF_RANGE)
        self._mode = _Mode.TRACKING
        if parameters == '80':
            self.frame_zero = self.now()
        self._frame = _Frame()
        return 'OKAY'

    def _on_tstop(self, _: str) -> str:
        self._need(_Mode.TRACKING)
        self._mode = _Mode.SETUP
        return 'OKAY'

    def _measured(self, options: str) -> tuple[_Frame, bool]:
        """The newest frame that is ready, and whether sensors out of volume are reported."""
        self._need(_Mode.TRACKING)
        wanted = _hexadecimal(options or '0001')
        if not wanted & _TRANSFORMS or wanted & ~(_TRANSFORMS | _NOT_NORMALLY_REPORTED):
            raise _Refusal(_OUT_OF_RANGE)
        ready = self.now() - self.frame_zero - self._latency
        number = math.floor(ready * FRAME_RATE)
        if number != self._frame.number:
            # Before the first frame is ready no sensor has been seen yet.
            self._frame = _Frame(
                number,
                {
                    handle: port.source(number / FRAME_RATE) if number >= 0 else None
                    for handle, port in self._ports.items()
                    if port.enabled
                },
            )
        return self._frame, bool(wanted & _NOT_NORMALLY_REPORTED)

    def _seen(self, handle: int, outside_too: bool) -> tuple[SensorView | None, PortStatus]:
        view, status = self._frame.views[handle], self._ports[handle].status
        if view is None:
            return None, status | PortStatus.OUT_OF_VOLUME
        if view.broken:
            return None, status | PortStatus.SENSOR_BROKEN
        if view.out_of_volume:
            return view if outside_too else None, status | PortStatus.OUT_OF_VOLUME
        return view, status

    def _on_tx(self, parameters: str) -> str:
        frame, outside_too = self._measured(parameters)
        text = f'{len(frame.views):02X}'
        for handle in frame.views:
            view, status = self._seen(handle, outside_too)
            text += f'{handle:02X}{"MISSING" if view is None else _transform_text(view)}'
            text += f'{status:08X}{max(0, frame.number):08X}\n'
        return text + '0000'

    def _on_bx(self, parameters: str) -> bytes:
        frame, outside_too = self._measured(parameters)
        body = bytes([len(frame.views)])
        for handle in frame.views:
            view, status = self._seen(handle, outside_too)
            if view is None:
                body += bytes([handle, 0x02])
            else:
                x, y, z, w = view.orientation
                millimetres = [1e3 * v for v in (*view.position, view.error)]
                body += bytes([handle, 0x01]) + struct.pack('<8f', w, x, y, z, *millimetres)
            body += struct.pack('<II', status, max(0, frame.number))
        body += b'\0\0'
        header = struct.pack('<HH', 0xA5C4, len(body))
        return b''.join(part + struct.pack('<H', crc16(part)) for part in (header, body))


def sealed(text: str) -> bytes:
    """A text reply with its CRC and carriage return."""
    raw = text.encode('latin-1')
    return raw + f'{crc16(raw):04X}\r'.encode()


def _transform_text(view: SensorView) -> str:
    x, y, z, w = view.orientation
    quaternion = ''.join(f'{round(v * 1e4):+06d}' for v in (w, x, y, z))
    position = ''.join(f'{round(v * 1e5):+07d}' for v in view.position)
    return f'{quaternion}{position}{round(view.error * 1e7):+06d}'


def _hexadecimal(text: str) -> int:
    try:
        return int(text, 16)
    except ValueError as error:
        raise _Refusal(_WRONG_PARAMETERS) from error
