"""Load cells behind a Modbus transmitter, read by a thread of their own."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from endoscope_devices.device import ReadingThread
from endoscope_devices.load_cells.calibration_file import (
    REGISTER_TYPES,
    LoadCellCalibration,
    decode_number,
)
from endoscope_devices.load_cells.channel_check import ChannelCheck
from endoscope_devices.load_cells.modbus_framing import (
    Framing,
    ReplyError,
    ReplyTrouble,
    RtuFraming,
    TcpFraming,
)
from endoscope_devices.load_cells.modbus_line import Line, LineLostError, SerialLine, TcpLine
from endoscope_devices.load_cells.register_reader import RegisterReader
from endoscope_devices.load_cells.tare import TareWindow, with_zero, zero_after_tare

_REOPEN_S = 0.2
# So many readings in a row that cannot be believed are a fault; a single spike is not.
_FAULTY_READINGS = 10
_KEPT = 2000


@dataclass(frozen=True)
class WireReading:
    """Believable tensions of all W wires in N."""

    time_ns: int  # when they were measured, of ``time.monotonic_ns``
    tension: tuple[float, ...]  # N, (W,)


class LoadCellDevice(Protocol):
    """Interface of load cells of any maker, for the node `load_cells`.

    A real one reads in a thread of its own: no call waits for the cells.
    """

    def open(self) -> None:
        """Start to read; cells that are not there yet are waited for, and are a trouble."""

    def take(self) -> list[WireReading]:
        """Believable readings of all wires since the last call, oldest first."""

    def note_shafts(self, velocity: Sequence[float]) -> None:
        """Take the speed of the motor shafts (J,) in rad/s, so that moving wires are not tared."""

    def tared(self) -> LoadCellCalibration:
        """The calibration in which the mean tension of the last second is zero, or TareError."""

    def use(self, calibration: LoadCellCalibration) -> None:
        """Go on with other zeros."""

    @property
    def trouble(self) -> str:
        """What is wrong; empty if nothing. Asked for in every tick."""

    def health(self) -> tuple[str, dict[str, object]]:
        """What is wrong (empty if nothing), and figures for diagnostics."""

    def close(self) -> None:
        """Release the cells."""


class ModbusLoadCells(ReadingThread[WireReading]):
    """Reads all wires at the calibration's rate and keeps the valid readings.

    A reading with one invalid channel is dropped as a whole.  A lost line is reopened for as long
    as the device is open.
    """

    def __init__(self, calibration: LoadCellCalibration, line: Line, framing: Framing) -> None:
        super().__init__('load cells', _KEPT)
        self.calibration = calibration
        self._line = line
        self._reader = RegisterReader(line, framing, calibration.transmitter.reply_timeout)
        cells = calibration.wires.values()
        self._first = min(cell.register for cell in cells)
        self._count = (
            max(cell.register + REGISTER_TYPES[cell.type].registers for cell in cells) - self._first
        )
        self._checks = [
            ChannelCheck(name, cell, calibration.faults) for name, cell in calibration.wires.items()
        ]
        self._window = TareWindow(tuple(calibration.wires), calibration.tare)
        self._lock = threading.Lock()
        self._unbelieved = 0
        self._link_trouble = 'not connected yet'
        self._line_lost = True

    def note_shafts(self, velocity: Sequence[float]) -> None:
        """Take the speed of the motor shafts (J,) in rad/s, so that moving wires are not tared."""
        with self._lock:
            self._window.note_shafts(time.monotonic_ns(), velocity)

    def tared(self) -> LoadCellCalibration:
        """The calibration in which the mean tension of the last second is zero, or TareError."""
        with self._lock:
            mean = self._window.mean(time.monotonic_ns())
            return with_zero(self.calibration, zero_after_tare(self.calibration, mean))

    def use(self, calibration: LoadCellCalibration) -> None:
        """Go on with other zeros."""
        with self._lock:
            self.calibration = calibration
            for check, cell in zip(self._checks, calibration.wires.values(), strict=True):
                check.cell = cell
            self._window = TareWindow(tuple(calibration.wires), calibration.tare)

    @property
    def trouble(self) -> str:
        """What is wrong; empty if nothing."""
        if self._line_lost:
            return self._link_trouble
        faults = [check.fault for check in self._checks if check.fault]
        if faults and self._unbelieved >= _FAULTY_READINGS:
            return '; '.join(faults)
        if self._silent():
            when = 'yet' if self._age_ns() is None else 'lately'
            return self._link_trouble or f'no believable reading {when}'
        return ''

    def health(self) -> tuple[str, dict[str, object]]:
        """What is wrong (empty if nothing), and figures for diagnostics."""
        figures = self._age_figure() | {
            'readings': self._counts['readings'],
            'not believed': self._counts['not believed'],
            'connections': self._counts['connections'],
            'unexpected bytes': self._reader.unexpected,
        }
        figures |= {str(kind): self._counts[kind] for kind in ReplyTrouble}
        for name, check in zip(self.calibration.wires, self._checks, strict=True):
            figures[f'{name}: zero [counts]'] = check.cell.zero
            figures[f'{name}: spikes'] = check.spikes
            figures[f'{name}: new levels'] = check.new_levels
        return self.trouble, figures

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._line.open()
                self._counts['connections'] += 1
                self._link_trouble = ''
                self._line_lost = False
                self._read_on()
            except LineLostError as error:
                self._link_trouble = str(error)
                self._line_lost = True
            finally:
                self._line.close()
            self._stop.wait(_REOPEN_S)

    def _read_on(self) -> None:
        period = 1.0 / self.calibration.transmitter.rate
        due = time.monotonic()
        while not self._stop.wait(max(0.0, due - time.monotonic())):
            due = max(due + period, time.monotonic())
            try:
                reading = self._reader.read(self._first, self._count)
            except ReplyError as error:
                self._counts[error.trouble] += 1
                self._link_trouble = str(error)
                continue
            self._link_trouble = ''
            with self._lock:
                self._judge(reading.asked_ns, reading.registers)

    def _judge(self, time_ns: int, registers: tuple[int, ...]) -> None:
        big = self.calibration.transmitter.word_order == 'big'
        tension = []
        for check in self._checks:
            start = check.cell.register - self._first
            words = registers[start : start + REGISTER_TYPES[check.cell.type].registers]
            tension.append(check.read(time_ns, decode_number(words, check.cell.type, big)))
        believed = tuple(value for value in tension if value is not None)
        if len(believed) < len(tension):
            self._counts['not believed'] += 1
            self._unbelieved += 1
            return
        self._unbelieved = 0
        self._window.add(time_ns, believed)
        latency_ns = round(self.calibration.transmitter.latency * 1e9)
        self._keep(WireReading(time_ns - latency_ns, believed), time_ns)


def modbus_rtu(port: str, calibration: LoadCellCalibration) -> ModbusLoadCells:
    """Load cells at a serial port, a device path."""
    transmitter = calibration.transmitter
    return ModbusLoadCells(
        calibration,
        SerialLine(port, transmitter.serial),
        RtuFraming(transmitter.unit, transmitter.function),
    )


def modbus_tcp(address: str, calibration: LoadCellCalibration) -> ModbusLoadCells:
    """Load cells at a TCP address, ``HOST`` or ``HOST:PORT``; DeviceError if it is neither."""
    transmitter = calibration.transmitter
    return ModbusLoadCells(
        calibration, TcpLine(address), TcpFraming(transmitter.unit, transmitter.function)
    )


CONNECTIONS: dict[str, Callable[[str, LoadCellCalibration], LoadCellDevice]] = {
    'modbus_rtu': modbus_rtu,
    'modbus_tcp': modbus_tcp,
}
"""Factory of load cells, by kind of connection."""
