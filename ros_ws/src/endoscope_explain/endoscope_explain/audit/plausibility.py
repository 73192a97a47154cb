"""Readings that the described plant cannot give, but would in another unit, sign or order.

The plant is simulated on the recorded command. A reading fits a simulated signal as far as a lag,
an offset and a scale that real rigs have carry one into the other. Where one does not, all are
tried in the units, signs and orders that people take by mistake, and the command is too. A mistake
is said where it makes the whole recording fit far better. Physics that is left out changes sizes
and shapes within those tolerances, or into what no mistake explains.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cache
from math import exp, log, pi

import numpy as np

from endoscope_core.physics.description import PlantDescription, SensorParameters
from endoscope_core.physics.on_stamps import hold_on_ticks
from endoscope_core.physics.simulator import LARGEST_COMMAND, TICK, simulate
from endoscope_explain.audit.finding import Column
from endoscope_explain.audit.misfit import (
    FOLLOWS,
    LONGEST_S,
    PERIOD_S,
    SCALES,
    USUAL,
    WORTH,
    Moments,
)
from endoscope_explain.audit.misreading import (
    CONVERTER_BITS,
    KINDS,
    OTHER_RIGS,
    Misreading,
    misreadings,
    scaled,
)
from endoscope_explain.recording import MOVES_RAD, Array, RigRecording, Series

MOST = 1.0
"""Misfit of what has nothing in common."""
NOISES = 10.0
"""Of a sensor, by which a signal must move for it not to stand still."""
NORMAL_MEDIAN = 0.6745
"""Median of the size of normal noise, in its rms."""


def sensor_noise(sensors: SensorParameters) -> dict[str, float]:
    """Noise, or step where that is more, of each measured quantity in its own unit."""
    return {
        'shaft_position': 2.0 * pi / sensors.encoder_counts,
        'shaft_velocity': sensors.velocity_resolution,
        'shaft_effort': max(sensors.effort_noise, sensors.effort_resolution),
        'tension': max(sensors.load_cell_noise, sensors.load_cell_resolution),
        'bending': sensors.tracker_noise,
    }


@dataclass(frozen=True)
class Way:
    """One way to read a quantity, and what speaks against it."""

    reading: Misreading
    shares: Array  # (columns,), misfit of each column
    misfit: float  # sum of their logarithms
    # By how much larger or smaller they are than simulated, in what rigs usually differ by.
    size: float

    @property
    def against(self) -> float:
        """Minus the logarithm of its likelihood."""
        return WORTH * self.misfit + self.size


class Comparison:
    """A recording with ordered stamps beside what the described plant makes of its command."""

    def __init__(
        self, recording: RigRecording, plant: PlantDescription, leave_out: Collection[str] = ()
    ) -> None:
        self._plant, self._rig = plant, recording.rig
        begin, end = _span(recording)
        self._grid = np.arange(begin, end, PERIOD_S)
        self._held = hold_on_ticks(
            np.maximum(recording.command.time - begin, 0.0),
            recording.command.values,
            len(self._grid) * round(PERIOD_S / TICK),
        )
        series = {q: s for q, s in recording.measured().items() if q not in leave_out}
        self._measured = {q: _on_grid(s, self._grid, q == 'bending') for q, s in series.items()}
        self._scatter = {q: _scatter(s) for q, s in series.items()}
        self._noise = sensor_noise(plant.sensors)
        self._readings = {
            q: tuple(misreadings(q, plant, self._rig.joints.gear, values.shape[1]))
            for q, values in {'command': self._held, **self._measured}.items()
        }
        self._right = self._readings['command'][0]
        self._simulated = cache(self._simulate)
        self._ways = cache(self._all_ways)

    def judged(self) -> tuple[Misreading, ...]:
        """Find the mistakes that make the recording more likely than their price, if any."""
        least = self._beyond_reach(self._right)
        least += sum(self._ways(self._right, q)[0].against for q in self._measured)
        at_best = sum(v.shape[1] * log(USUAL[q]) for q, v in self._measured.items())
        best: tuple[Misreading, ...] = ()
        if least - WORTH * at_best < log(KINDS):
            return best
        for drive in self._readings['command']:
            if drive.price and not self._may_be_meant(drive):
                continue
            against, meant = self._beyond_reach(drive), [drive]
            for quantity in self._measured:
                of_gear = drive.of_gear and quantity == 'shaft_position'
                way = min(
                    (w for w in self._ways(drive, quantity) if not (of_gear and w.reading.of_gear)),
                    key=lambda w: w.against + w.reading.price,
                )
                against += way.against
                meant.append(way.reading)
            mistakes = tuple(reading for reading in meant if reading.price)
            # All that a motor's messages hold is exchanged together.
            once = {
                (m.quantity.partition('_')[0] if m.kind == 'order' else m.quantity, m.source): m
                for m in mistakes
            }
            against += sum(m.price for m in once.values())
            if against < least - 1e-9:
                least, best = against, mistakes
        return best

    def shares(self, mistakes: Collection[Misreading] = ()) -> dict[str, Array]:
        """Misfit of each column of each quantity (columns,), read with these mistakes put right."""
        meant = {mistake.quantity: mistake for mistake in mistakes}
        drive = meant.get('command', self._right)
        return {
            q: next(
                w.shares
                for w in self._ways(drive, q)
                if w.reading == meant.get(q, self._readings[q][0])
            )
            for q in self._measured
        }

    def unlike(self, mistakes: Collection[Misreading]) -> list[Column]:
        """Columns that must move and are nothing like the simulated ones."""
        # What they share is worth less than the scale that was fitted for it (Schwarz).
        least = exp(-0.5 * log(WORTH) / WORTH)
        drive = next((m for m in mistakes if m.quantity == 'command'), self._right)
        return [
            (quantity, column)
            for quantity, shares in self.shares(mistakes).items()
            for column, share in enumerate(shares)
            if share > least and self.must_move((quantity, column), 0.0, drive)
        ]

    def must_move(self, column: Column, since: float, drive: Misreading | None = None) -> bool:
        """Whether a column moves by more than its noise from `since` s on, as simulated."""
        quantity, place = column
        signal = self._simulated(drive or self._right)[quantity][self._grid >= since, place]
        least = max(NOISES * self._noise[quantity], MOVES_RAD)
        return len(signal) > 1 and bool(np.ptp(signal) > least)

    def is_noisy(self) -> bool:
        """Whether the readings have noise, as those of a simulation have not."""
        return any(
            bool((self._scatter[q] > 0.1 * self._noise[q]).any())
            for q in ('tension', 'bending')
            if q in self._measured
        )

    def _may_be_meant(self, drive: Misreading) -> bool:
        """Whether it moves, and either cannot be what was given or the shafts follow it."""
        if np.ptp(self._shaft(drive)[:, list(drive.touched)], axis=0).max() < MOVES_RAD:
            return False
        if np.abs(self._held).max() > self._rig.motors.reach:
            return True
        # Bending and tension of half the motion may be those of another rig.
        if 'shaft_position' not in self._measured:
            return not drive.of_gear
        followed = self._ways(drive, 'shaft_position')
        allowed = log(FOLLOWS) * self._held.shape[1]
        return any(w.misfit <= allowed for w in followed if w.reading.kind in ('right', 'sign'))

    def _beyond_reach(self, drive: Misreading) -> float:
        """What speaks against a command that turns shafts further than the rig lets them."""
        # Of bending nothing is learnt: it follows any command at some scale.
        turned = np.abs(self._held[:, list(drive.source)] / np.asarray(drive.factor)).max(axis=0)
        columns = int((turned > self._rig.motors.reach).sum())
        return columns * WORTH * log(MOST / USUAL['shaft_position'])

    def _shaft(self, command: Misreading) -> Array:
        shaft = self._held[:, list(command.source)] / np.asarray(command.factor)
        return np.clip(shaft, -LARGEST_COMMAND, LARGEST_COMMAND)

    def _simulate(self, command: Misreading) -> dict[str, Array]:
        """What the plant makes of the command as it is meant, by quantity (N, columns)."""
        shaft = self._shaft(command)
        answer = simulate(self._plant, shaft, start_shaft=shaft[0])
        every = round(PERIOD_S / TICK)
        return {q: getattr(answer, q).reshape(len(shaft), -1)[::every] for q in self._measured}

    def _all_ways(self, command: Misreading, quantity: str) -> list[Way]:
        """All ways to read a quantity where the command is meant so."""
        moments = Moments.of(self._measured[quantity], self._simulated(command)[quantity])
        usual, largest = USUAL[quantity], SCALES[quantity][1]
        rest = (quantity, self._noise[quantity], self._scatter[quantity])
        misfit = cache(lambda factor: moments.misfit(factor, *rest))
        found = []
        for reading in (*self._readings[quantity], *_of_any_size(quantity, moments)):
            each = zip(reading.source, reading.factor, strict=True)
            columns = [misfit(factor)[:, source, c] for c, (source, factor) in enumerate(each)]
            share, scale = np.transpose(columns)
            kept = np.log(np.clip(share, usual, MOST))
            size = np.abs(np.log(np.maximum(scale, usual))) / max(log(largest), usual)
            found.append(Way(reading, share, float(kept.sum()), float(size.sum())))
        return found


def _of_any_size(quantity: str, moments: Moments) -> Iterator[Misreading]:
    """Readings of a factor that belongs to no unit: of a gear, or of a converter."""
    if quantity not in ('shaft_position', 'tension'):
        return
    size = moments.size()
    columns = len(size)
    whole = tuple(range(columns))
    parts = [whole] if quantity == 'tension' else [*((c,) for c in whole), whole]
    ways = CONVERTER_BITS * log(2.0) / USUAL[quantity]
    for part in dict.fromkeys(parts):
        factor = float(np.median(size[list(part)]))
        of_a_rig = quantity == 'tension' and 1.0 / OTHER_RIGS <= factor <= OTHER_RIGS
        if factor > 0.0 and not of_a_rig:
            many = len(parts) - 1 if len(part) < columns else 1
            yield scaled(quantity, 'factor', factor, part, columns, ways * many)


def as_meant(recording: RigRecording, mistakes: Collection[Misreading]) -> RigRecording:
    """Return the recording with its columns in the units, signs and order that fit."""
    changed = {}
    every = {'command': recording.command, **recording.measured()}
    for mistake in mistakes:
        series = every[mistake.quantity]
        flat = (len(series.values), -1)
        values = series.values.reshape(flat)[:, list(mistake.source)] / np.asarray(mistake.factor)
        valid = series.valid.reshape(flat)[:, list(mistake.source)]
        changed[mistake.quantity] = replace(
            series,
            values=values.reshape(series.values.shape),
            valid=valid.reshape(series.valid.shape),
        )
    return recording.with_series(changed)


def _span(recording: RigRecording) -> tuple[float, float]:
    """From shortly before the first motion, no longer than is needed."""
    command = recording.command
    away = np.abs(command.values - command.values[0]).max(axis=1) >= MOVES_RAD
    first = float(command.time[np.argmax(away)]) if away.any() else float(command.time[0])
    every = recording.measured().values()
    begin = max(float(command.time[0]), first - 1.0)
    end = min(max(float(s.time[-1]) for s in every), begin + LONGEST_S)
    return begin, end


def _scatter(series: Series) -> Array:
    """Noise (columns,) of a quantity from sample to sample, in its own unit."""
    values = series.values.reshape(len(series.values), -1)
    if len(values) < 3:
        return np.zeros(values.shape[1])
    bow = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    return np.asarray(np.median(np.abs(bow), axis=0) / NORMAL_MEDIAN / np.sqrt(1.5))


def _on_grid(series: Series, grid: Array, spiky: bool) -> Array:
    """Values (N, columns) at the times of a grid, isolated wrong ones left out."""
    values = series.values.reshape(len(series.values), -1)
    valid = series.valid.reshape(values.shape)
    if spiky and len(values) > 2:
        inner = np.median(np.stack([values[:-2], values[1:-1], values[2:]]), axis=0)
        values = np.concatenate([values[:1], inner, values[-1:]])
    columns = []
    for column in range(values.shape[1]):
        use = valid[:, column] if valid[:, column].any() else np.ones(len(values), bool)
        columns.append(np.interp(grid, series.time[use], values[use, column]))
    return np.stack(columns, axis=1)
