"""The YAML file that turns registers of a load-cell transmitter into wire tensions.

::

    transmitter:
      unit: 1                 # Modbus address
      registers: input        # input (function 4) or holding (function 3)
      word_order: big         # which register of a 32-bit value comes first
      rate: 200.0             # readings a second
      reply_timeout: 0.02     # s
      latency: 0.0            # s from the wire to its register, by which stamps are put back
      serial: {baud: 115200, parity: none, stop_bits: 1}     # for modbus_rtu
    wires:                    # tension = sign * newton_per_count * (count - zero)
      wire_x_pos: {register: 0, type: int32, newton_per_count: 0.001, sign: 1, zero: 120}
      ...
    faults:                   # in counts; a broken bridge drives the amplifier beyond its range
      broken_below: -200000
      broken_above: 200000
      saturated_below: -20000
      saturated_above: 150000
      frozen_after: 0.5       # s without a change of the last digit; 0 for cells without noise
      spike_rate: 1650.0      # N/s, faster than any wire
      spike_noise: 1.0        # N
    tare: {noise: 0.1, drift: 0.05, largest: 2.0, shaft_speed: 0.02}     # N, N, N, rad/s

``faults`` needs the four counts; everything else but ``wires`` has the values above.
"""

import hashlib
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field, make_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from endoscope_core.schema import blamed_on, load, one_of, within

Count = Annotated[float, within(-1e12, 1e12)]
_Limit = Annotated[float, within(0.0)]
_IN_ONE_REPLY = 125


@dataclass(frozen=True)
class RegisterType:
    """A type by its number of registers and its format in the ``struct`` module."""

    registers: int
    format: str


REGISTER_TYPES = {
    'int16': RegisterType(1, '>h'),
    'uint16': RegisterType(1, '>H'),
    'int32': RegisterType(2, '>i'),
    'uint32': RegisterType(2, '>I'),
    'float32': RegisterType(2, '>f'),
}


def decode_number(registers: Sequence[int], kind: str, big_word_first: bool) -> float:
    """A number in counts, of a type `kind` of ``REGISTER_TYPES``, from its 16-bit registers.

    Bytes within a register are big-endian (Modbus Application Protocol V1.1b3, section 4.2); the
    order of registers is the maker's choice. May be NaN for ``float32``.
    """
    words = registers if big_word_first else tuple(reversed(registers))
    raw = struct.pack(f'>{len(words)}H', *words)
    return float(struct.unpack(REGISTER_TYPES[kind].format, raw)[0])


@dataclass(frozen=True)
class SerialSettings:
    """Line settings of Modbus RTU: baud rate in bit/s, parity, stop bits."""

    baud: Annotated[int, within(1200, 4_000_000)] = 115200
    parity: Literal['none', 'even', 'odd'] = 'none'
    stop_bits: Annotated[int, within(1, 2)] = 1


@dataclass(frozen=True)
class Transmitter:
    """How the transmitter is asked."""

    unit: Annotated[int, within(1, 247)] = 1  # Modbus address
    registers: Literal['input', 'holding'] = 'input'
    word_order: Literal['big', 'little'] = 'big'  # which register of a 32-bit value comes first
    rate: Annotated[float, within(0.1, 1000.0)] = 200.0  # Hz
    reply_timeout: Annotated[float, within(0.001, 5.0)] = 0.02  # s
    # s by which a register is older than the question: filter, conversion
    latency: Annotated[float, within(0.0, 0.5)] = 0.0
    serial: SerialSettings = field(default_factory=SerialSettings)  # for RTU

    @property
    def function(self) -> int:
        """Modbus function that reads the registers."""
        return 4 if self.registers == 'input' else 3


@dataclass(frozen=True)
class WireCell:
    """One cell: ``tension = sign * newton_per_count * (count - zero)``."""

    register: Annotated[int, within(0, 65535)]  # the first
    type: Annotated[str, one_of(REGISTER_TYPES)]
    newton_per_count: Annotated[float, within(1e-9, 1e6)]  # sensitivity
    sign: Literal[1, -1] = 1  # which way the count goes when the wire is pulled
    zero: Count = 0.0  # count without tension

    def tension(self, count: float) -> float:
        """Tension in N at a count."""
        return self.sign * self.newton_per_count * (count - self.zero)


@dataclass(frozen=True)
class FaultLimits:
    """What no real tension does; a ValueError where limits in counts are not in order."""

    broken_below: Count
    broken_above: Count
    saturated_below: Count
    saturated_above: Count
    frozen_after: Annotated[float, within(0.0, 60.0)] = 0.5  # s; 0 to leave it out
    # Fastest change in N/s. A wire of stiffness k on a pulley of radius r, whose shaft turns at w,
    # changes its tension at the cell by k r w exp(phi) at most, phi being the sheath's capstan
    # exponent (Euler-Eytelwein): 1620 N/s for the nominal 2000 N/m and 5 mm, the greatest exponent
    # of 3 and the 8.06 rad/s of an XM430-W210 without load.
    spike_rate: Annotated[float, within(1.0, 1e9)] = 1650.0
    # What noise may add in N: seven times that of a difference of two readings at the 0.1 N rms
    # that a tare allows.
    spike_noise: Annotated[float, within(0.0, 1e6)] = 1.0

    def __post_init__(self) -> None:
        if not (
            self.broken_below <= self.saturated_below < self.saturated_above <= self.broken_above
        ):
            raise ValueError(
                'give broken_below <= saturated_below < saturated_above <= broken_above'
            )


@dataclass(frozen=True)
class TareLimits:
    """When a tare is refused."""

    noise: _Limit = 0.1  # largest standard deviation, N
    drift: _Limit = 0.05  # largest change from one half second to the next, N
    largest: _Limit = 2.0  # tension that may be taken for zero, N
    shaft_speed: _Limit = 0.02  # rad/s from which the wires count as moving


@dataclass(frozen=True)
class LoadCellCalibration:
    """Content of a calibration file."""

    transmitter: Transmitter
    wires: dict[str, WireCell]  # by name, in the order asked for
    faults: FaultLimits
    tare: TareLimits
    digest: str  # SHA-256 of the file, which ties a stored tare to it


def load_calibration(path: str | Path, wires: Sequence[str]) -> LoadCellCalibration:
    """Read a calibration file, which has to have these wires and no others.

    FileError where it cannot be read, or a key is unknown, missing or out of range.
    """
    what = 'load-cell calibration'
    file = load(_file(wires), path, what)
    cells = vars(file.wires)
    with blamed_on(f'{what} {path}: wires'):
        _check_registers(cells)
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    return LoadCellCalibration(file.transmitter, cells, file.faults, file.tare, digest)


def _file(wires: Sequence[str]) -> Any:
    """The dataclass of a whole file, which has exactly these wires."""
    return make_dataclass(
        'File',
        [
            ('wires', make_dataclass('Wires', [(name, WireCell) for name in wires])),
            ('faults', FaultLimits),
            ('transmitter', Transmitter, field(default_factory=Transmitter)),
            ('tare', TareLimits, field(default_factory=TareLimits)),
        ],
    )


def _check_registers(cells: dict[str, WireCell]) -> None:
    taken: dict[int, str] = {}
    for name, cell in cells.items():
        for register in range(cell.register, cell.register + REGISTER_TYPES[cell.type].registers):
            if register in taken:
                raise ValueError(
                    f'{taken[register]} and {name} share register {register}: give each its own'
                )
            taken[register] = name
    span = max(taken) - min(taken) + 1
    if span > _IN_ONE_REPLY:
        raise ValueError(f'the registers span {span}; one Modbus reply carries {_IN_ONE_REPLY}')
