"""A load-cell transmitter on a real line, whose cells a test pulls and breaks."""

import struct
import time
from collections import deque
from pathlib import Path

import numpy as np

from endoscope_emulators.transmitter import TransmitterEmulator
from endoscope_nodes.names import WIRES

NEWTON_PER_COUNT = 0.001
ZERO = 120
BROKEN = 8_388_607
SATURATED = 95_000

LATENCY = 0.05
TRANSMITTER = 'rate: 200, reply_timeout: 0.05'
CALIBRATION = f"""
wires:
  wire_x_pos: {{register: 0, type: int32, newton_per_count: {NEWTON_PER_COUNT}, zero: {ZERO}}}
  wire_x_neg: {{register: 2, type: int32, newton_per_count: {NEWTON_PER_COUNT}, zero: {ZERO}}}
  wire_y_pos: {{register: 4, type: int32, newton_per_count: {NEWTON_PER_COUNT}, zero: {ZERO}}}
  wire_y_neg: {{register: 6, type: int32, newton_per_count: {NEWTON_PER_COUNT}, zero: {ZERO}}}
faults:
  broken_below: -200000
  broken_above: 200000
  saturated_below: -20000
  saturated_above: 90000
"""


class Cells:
    """Four cells with a count or two of noise; a test sets tension and faults by wire."""

    def __init__(self) -> None:
        self.tension = dict.fromkeys(WIRES, 5.0)
        self.extra = {}
        self.count = {}
        self.once = {}
        self.freeze = set()
        self.busy = False
        self._noise = np.random.default_rng(3)
        self._last = dict.fromkeys(WIRES, 0)

    def follow(self, sample) -> None:
        self.tension = dict(zip(WIRES, sample.effort, strict=True))

    def __call__(self, _time):
        if self.busy:
            return None
        words = []
        for wire in WIRES:
            if wire not in self.freeze:
                tension = self.tension[wire] + self.extra.get(wire, 0.0)
                pulled = round(tension / NEWTON_PER_COUNT) + ZERO
                self._last[wire] = pulled + int(self._noise.integers(-2, 3))
            count = self.count.get(wire, self._last[wire])
            words += struct.unpack('>HH', struct.pack('>i', self.once.pop(wire, count)))
        return words


class CellsOnWires(Cells):
    """Cells with the nominal rig's noise, on the wires of a slave that moves between two beats.

    They show what the wires did `LATENCY` ago, when the slave had simulated what came next.
    """

    def __init__(self) -> None:
        super().__init__()
        self._followed = deque(maxlen=100)
        self._clock_offset = time.time() - time.monotonic()
        self._own = np.random.default_rng(4)

    def follow(self, sample) -> None:
        self._followed.append((sample.stamp_ns * 1e-9 - self._clock_offset, *sample.effort))

    def __call__(self, seconds):
        if self._followed:
            then, *wires = zip(*tuple(self._followed), strict=True)
            at = time.monotonic() - LATENCY
            self.tension = {
                wire: float(np.interp(at, then, tension)) + self._own.normal(0.0, 0.02)
                for wire, tension in zip(WIRES, wires, strict=True)
            }
        return super().__call__(seconds)


def write_calibration(folder: Path, transmitter: str = TRANSMITTER) -> Path:
    path = folder / 'cells.yaml'
    path.write_text(f'transmitter: {{{transmitter}}}{CALIBRATION}')
    return path


def transmitter(cells: Cells, **line) -> TransmitterEmulator:
    return TransmitterEmulator(cells, 2 * len(WIRES), **line)
