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
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from endoscope_devices.load_cells.registers import REGISTER_TYPES
from endoscope_devices.strict_yaml import DeviceFileError, Section, load_section

_COUNTS = 1e12


@dataclass(frozen=True)
class SerialSettings:
    """Line settings of Modbus RTU: baud rate in bit/s, parity as pyserial names it, stop bits."""

    baud: int = 115200
    parity: str = 'N'
    stop_bits: int = 1


@dataclass(frozen=True)
class Transmitter:
    """How the transmitter is asked."""

    unit: int  # Modbus address
    function: int  # 3 (holding registers) or 4 (input registers)
    big_word_first: bool  # whether the more significant register of a 32-bit value comes first
    rate: float  # Hz
    reply_timeout: float  # s
    latency: float  # s by which a register is older than the question: filter, conversion
    serial: SerialSettings  # for RTU


@dataclass(frozen=True)
class WireCell:
    """One cell: ``tension = sign * newton_per_count * (count - zero)``."""

    register: int  # the first
    type: str  # a key of ``REGISTER_TYPES``
    newton_per_count: float  # sensitivity
    sign: int  # 1 or -1: which way the count goes when the wire is pulled
    zero: float  # count without tension

    def tension(self, count: float) -> float:
        """Tension in N at a count."""
        return self.sign * self.newton_per_count * (count - self.zero)


@dataclass(frozen=True)
class FaultLimits:
    """What no real tension does."""

    broken_below: float  # counts, as the next three
    broken_above: float
    saturated_below: float
    saturated_above: float
    frozen_after: float = 0.5  # s; 0 to leave it out
    # Fastest change in N/s. A wire of stiffness k on a pulley of radius r, whose shaft turns at w,
    # changes its tension at the cell by k r w exp(phi) at most, phi being the sheath's capstan
    # exponent (Euler-Eytelwein): 1620 N/s for the nominal 2000 N/m and 5 mm, the greatest exponent
    # of 3 and the 8.06 rad/s of an XM430-W210 without load.
    spike_rate: float = 1650.0
    # What noise may add in N: seven times that of a difference of two readings at the 0.1 N rms
    # that a tare allows.
    spike_noise: float = 1.0


@dataclass(frozen=True)
class TareLimits:
    """When a tare is refused."""

    noise: float = 0.1  # largest standard deviation, N
    drift: float = 0.05  # largest change from one half second to the next, N
    largest: float = 2.0  # tension that may be taken for zero, N
    shaft_speed: float = 0.02  # rad/s from which the wires count as moving


@dataclass(frozen=True)
class LoadCellCalibration:
    """Content of a calibration file.

    Attributes
    ----------
    wires
        Cells by wire name, in the order asked for.
    digest
        SHA-256 of the file, which ties a stored tare to it.
    """

    transmitter: Transmitter
    wires: dict[str, WireCell]
    faults: FaultLimits
    tare: TareLimits
    digest: str


def load_calibration(path: str | Path, wires: Sequence[str]) -> LoadCellCalibration:
    """Read a calibration file.

    Parameters
    ----------
    path
        The YAML file.
    wires
        The wires that it has to have, and no others.

    Raises
    ------
    DeviceFileError
        It cannot be read, or a key is unknown, missing or out of range.
    """
    file = load_section(path, 'load-cell calibration', ('transmitter', 'wires', 'faults', 'tare'))
    transmitter = _transmitter(
        file.section(
            'transmitter',
            ('unit', 'registers', 'word_order', 'rate', 'reply_timeout', 'latency', 'serial'),
            required=False,
        )
    )
    listed = file.section('wires', wires)
    cells = {
        name: _cell(listed.section(name, ('register', 'type', 'newton_per_count', 'sign', 'zero')))
        for name in wires
    }
    _check_overlap(path, cells)
    return LoadCellCalibration(
        transmitter,
        cells,
        _faults(path, file),
        _tare(file.section('tare', tuple(TareLimits.__annotations__), required=False)),
        hashlib.sha256(Path(path).read_bytes()).hexdigest(),
    )


def _transmitter(section: Section) -> Transmitter:
    serial = section.section('serial', ('baud', 'parity', 'stop_bits'), required=False)
    parity = serial.choice('parity', ('none', 'even', 'odd'), 'none')
    settings = SerialSettings(
        serial.whole('baud', 1200, 4_000_000, 115200),
        parity[0].upper(),
        serial.whole('stop_bits', 1, 2, 1),
    )
    return Transmitter(
        section.whole('unit', 1, 247, 1),
        4 if section.choice('registers', ('input', 'holding'), 'input') == 'input' else 3,
        section.choice('word_order', ('big', 'little'), 'big') == 'big',
        section.number('rate', 0.1, 1000.0, 200.0),
        section.number('reply_timeout', 0.001, 5.0, 0.02),
        section.number('latency', 0.0, 0.5, 0.0),
        settings,
    )


def _cell(section: Section) -> WireCell:
    return WireCell(
        section.whole('register', 0, 65535),
        section.choice('type', tuple(REGISTER_TYPES)),
        section.number('newton_per_count', 1e-9, 1e6),
        section.sign('sign', 1),
        section.number('zero', -_COUNTS, _COUNTS, 0.0),
    )


def _check_overlap(path: str | Path, cells: dict[str, WireCell]) -> None:
    taken: dict[int, str] = {}
    for name, cell in cells.items():
        for register in range(cell.register, cell.register + REGISTER_TYPES[cell.type].registers):
            if register in taken:
                raise DeviceFileError(
                    f'load-cell calibration {path}: wires: {taken[register]} and {name} share '
                    f'register {register}: give each its own'
                )
            taken[register] = name
    if max(taken) - min(taken) >= 125:
        raise DeviceFileError(
            f'load-cell calibration {path}: wires: the registers span '
            f'{max(taken) - min(taken) + 1}; one Modbus reply carries 125'
        )


def _faults(path: str | Path, file: Section) -> FaultLimits:
    section = file.section('faults', tuple(FaultLimits.__annotations__))
    limits = FaultLimits(
        section.number('broken_below', -_COUNTS, _COUNTS),
        section.number('broken_above', -_COUNTS, _COUNTS),
        section.number('saturated_below', -_COUNTS, _COUNTS),
        section.number('saturated_above', -_COUNTS, _COUNTS),
        section.number('frozen_after', 0.0, 60.0, FaultLimits.frozen_after),
        section.number('spike_rate', 1.0, 1e9, FaultLimits.spike_rate),
        section.number('spike_noise', 0.0, 1e6, FaultLimits.spike_noise),
    )
    if not (
        limits.broken_below
        <= limits.saturated_below
        < limits.saturated_above
        <= limits.broken_above
    ):
        raise DeviceFileError(
            f'load-cell calibration {path}: faults: give broken_below <= saturated_below < '
            'saturated_above <= broken_above'
        )
    return limits


def _tare(section: Section) -> TareLimits:
    return TareLimits(
        section.number('noise', 0.0, math.inf, TareLimits.noise),
        section.number('drift', 0.0, math.inf, TareLimits.drift),
        section.number('largest', 0.0, math.inf, TareLimits.largest),
        section.number('shaft_speed', 0.0, math.inf, TareLimits.shaft_speed),
    )
