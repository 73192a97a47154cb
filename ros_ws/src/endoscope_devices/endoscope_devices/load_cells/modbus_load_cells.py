"""Load cells behind a Modbus transmitter, read by a thread of their own, each reading judged."""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from endoscope_devices.device import ReadingThread
from endoscope_devices.load_cells.calibration_file import (
    REGISTER_TYPES,
    FaultLimits,
    LoadCellCalibration,
    WireCell,
    decode_number,
)
from endoscope_devices.load_cells.modbus_framing import (
    Framing,
    ReplyError,
    ReplyTrouble,
    RtuFraming,
    TcpFraming,
)
from endoscope_devices.load_cells.modbus_line import (
    Line,
    LineLostError,
    RegisterReader,
    SerialLine,
    TcpLine,
)
from endoscope_devices.load_cells.tare import TareWindow, with_zero, zero_after_tare

# So many good readings in a row end a fault, and so many consistent ones make a step a new level.
CONFIRMATIONS = 3
_SPIKES = 5
_SPIKES_WITHIN_NS = 1_000_000_000
_REOPEN_S = 0.2
# So many readings in a row that cannot be believed are a fault; a single spike is not.
_FAULTY_READINGS = 10
_KEPT = 2000


class ChannelCheck:
    """Judges each reading of one cell.

    Broken: only an open bridge drives the amplifier there. Frozen: the noise of a working cell
    changes its last digit. Spiking: faster than ``spike_rate``, until three readings agree on a new
    level. An old reply of Modbus RTU, which has no transaction number, is detected only here, where
    the tension has changed by more than a wire can in one interval.
    """

    def __init__(self, wire: str, cell: WireCell, limits: FaultLimits) -> None:
        self._wire = wire
        self._limits = limits
        self.cell = cell
        self.fault = ''  # what is wrong, naming the wire; empty while readings are good
        self.spikes = 0  # readings that changed too fast
        self.new_levels = 0  # how often three of them were taken for a new level
        self._good = 0
        self._spiked_ns: deque[int] = deque(maxlen=_SPIKES)
        self._count = math.nan
        self._changed_ns = 0
        self._level = math.nan
        self._level_ns = 0
        self._candidate = math.nan
        self._candidate_ns = 0
        self._agreeing = 0

    def read(self, time_ns: int, count: float) -> float | None:
        """Take a count at steady ns; the tension in N unless a fault is there or just over."""
        trouble = self._trouble(time_ns, count)
        if trouble:
            self.fault = f'{self._wire}: {trouble}'
            self._good = 0
            return None
        self._good += 1
        if self.fault:
            if self._good < CONFIRMATIONS:
                return None
            self.fault = ''
        return self.cell.tension(count)

    def _trouble(self, time_ns: int, count: float) -> str:
        limits = self._limits
        if not math.isfinite(count) or not limits.broken_below < count < limits.broken_above:
            return f'broken wire of the cell ({count:.6g} counts)'
        if not limits.saturated_below < count < limits.saturated_above:
            return f'saturated ({count:.6g} counts)'
        if count != self._count:
            self._count = count
            self._changed_ns = time_ns
        still = (time_ns - self._changed_ns) * 1e-9
        if 0.0 < limits.frozen_after <= still:
            return f'frozen ({count:.6g} counts for {still:.1f} s)'
        jump = self._jump(time_ns, self.cell.tension(count))
        many = len(self._spiked_ns) == _SPIKES and (
            time_ns - self._spiked_ns[0] < _SPIKES_WITHIN_NS
        )
        return f'spiking ({_SPIKES} times within a second)' if many else jump

    def _jump(self, time_ns: int, tension: float) -> str:
        if math.isnan(self._level) or self._near(self._level, self._level_ns, tension, time_ns):
            self._take(time_ns, tension)
            return ''
        self.spikes += 1
        self._spiked_ns.append(time_ns)
        agrees = self._near(self._candidate, self._candidate_ns, tension, time_ns)
        self._agreeing = self._agreeing + 1 if agrees else 1
        self._candidate, self._candidate_ns = tension, time_ns
        if self._agreeing >= CONFIRMATIONS:
            self.new_levels += 1
            self._take(time_ns, tension)
            return ''
        return f'spiking (from {self._level:.2f} N to {tension:.2f} N)'

    def _near(self, before: float, before_ns: int, tension: float, time_ns: int) -> bool:
        allowed = self._limits.spike_noise + self._limits.spike_rate * (time_ns - before_ns) * 1e-9
        return abs(tension - before) <= allowed

    def _take(self, time_ns: int, tension: float) -> None:
        self._level, self._level_ns = tension, time_ns
        self._agreeing = 0
        self._candidate = math.nan


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
    """Reads all wires, whole readings or none; a lost line is reopened while it is open."""

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
