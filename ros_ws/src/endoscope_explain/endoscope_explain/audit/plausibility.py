"""Readings that the described plant cannot give, but would in another unit, sign or order.

The plant is simulated on the recorded command. A reading fits a simulated signal as far as a lag,
an offset and a scale that real rigs have carry one into the other. Where one does not, all are
tried in the units, signs and orders that people take by mistake, and the command is too. A mistake
is said where it makes the whole recording fit far better. Physics that is left out changes sizes
and shapes within those tolerances, or into what no mistake explains.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from math import exp, inf, log, pi

import numpy as np

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.on_stamps import hold_on_ticks
from endoscope_core.physics.simulator import LARGEST_COMMAND, TICK, simulate
from endoscope_explain.audit.criteria import DERIVED
from endoscope_explain.audit.misfit import LONGEST_S, PERIOD_S, Bounds, Moments
from endoscope_explain.audit.misreading import (
    CONVERTER_BITS,
    KINDS,
    OTHER_RIGS,
    Misreading,
    misreadings,
    scaled,
)
from endoscope_explain.audit.standing_still import must_move
from endoscope_explain.recording import MOVES_RAD, Array, Recording, Series

TURN_RAD = 2.0 * pi
"""No section bends further, from one side to the other."""
MOST = 1.0
"""Misfit of what has nothing in common."""


@dataclass(frozen=True)
class Way:
    """One way to read a quantity, and what speaks against it."""

    reading: Misreading
    shares: Array  # (columns,), misfit of each column
    misfit: float  # sum of their logarithms
    # By how much larger or smaller they are than simulated, in what rigs usually differ by.
    size: float

    def against(self, worth: float) -> float:
        """Minus the logarithm of its likelihood where a column is worth so many samples."""
        return worth * self.misfit + self.size


class Comparison:
    """A recording with ordered stamps beside what the described plant makes of its command."""

    def __init__(
        self, recording: Recording, plant: PlantDescription, leave_out: Collection[str] = ()
    ) -> None:
        self._plant, self._rig = plant, recording.rig
        begin, end = _span(recording)
        self.grid = np.arange(begin, end, PERIOD_S)
        self._held = hold_on_ticks(
            np.maximum(recording.command.time - begin, 0.0),
            recording.command.values,
            len(self.grid) * round(PERIOD_S / TICK),
        )
        self.measured = {
            quantity: _on_grid(series, self.grid, quantity == 'bending')
            for quantity, series in recording.measured().items()
            if quantity not in leave_out
        }
        self._scatter = {
            quantity: _scatter(recording.measured()[quantity]) for quantity in self.measured
        }
        self._readings = {
            quantity: tuple(self._misreadings(quantity, values.shape[1]))
            for quantity, values in self.measured.items()
        }
        self._answers: dict[Misreading, dict[str, Array]] = {}
        self._known: dict[tuple[Misreading, str], list[Way]] = {}
        sensors = plant.sensors
        self.noise = {
            'shaft_position': 2.0 * pi / sensors.encoder_counts,
            'shaft_velocity': sensors.velocity_resolution,
            'shaft_effort': max(sensors.effort_noise, sensors.effort_resolution),
            'tension': max(sensors.load_cell_noise, sensors.load_cell_resolution),
            'bending': sensors.tracker_noise,
        }

    def judged(self, worth: float | None = None) -> tuple[Misreading, ...]:
        """Find the mistakes that make the recording more likely than their price, if any."""
        worth = DERIVED.worth if worth is None else worth
        right, usual = self._right(), DERIVED.usual
        as_read = self._beyond_reach(right, worth)
        as_read += sum(self._ways(right, q)[0].against(worth) for q in self.measured)
        at_best = sum(self.measured[q].shape[1] * log(usual[q]) for q in self.measured)
        if as_read - worth * at_best < log(KINDS):
            return ()
        least = as_read
        best: tuple[Misreading, ...] = ()
        for drive in self._misreadings('command', self._held.shape[1]):
            if drive.price and not self._may_be_meant(drive):
                continue
            against, said = self._beyond_reach(drive, worth), [drive] if drive.price else []
            for quantity in self.measured:
                of_gear = drive.of_gear and quantity == 'shaft_position'
                way = min(
                    (w for w in self._ways(drive, quantity) if not (of_gear and w.reading.of_gear)),
                    key=lambda w: w.against(worth) + w.reading.price,
                )
                against += way.against(worth)
                said += [way.reading] if way.reading.price else []
            against += sum(_prices(said))
            if against < least - 1e-9:
                least, best = against, tuple(said)
        return best

    def shares(self, mistakes: Collection[Misreading] = ()) -> dict[str, Array]:
        """Misfit of each column of each quantity (columns,), read with these mistakes put right."""
        meant = {mistake.quantity: mistake for mistake in mistakes}
        drive = meant.get('command', self._right())
        return {
            q: next(
                w.shares
                for w in self._ways(drive, q)
                if w.reading == meant.get(q, self._readings[q][0])
            )
            for q in self.measured
        }

    def unlike(self, mistakes: Collection[Misreading]) -> list[tuple[str, int]]:
        """Quantities and columns that must move and are nothing like the simulated ones."""
        # What they share is worth less than the scale that was fitted for it (Schwarz).
        worth = DERIVED.worth
        least = exp(-0.5 * log(worth) / worth)
        drive = next((m for m in mistakes if m.quantity == 'command'), self._right())
        return [
            (quantity, column)
            for quantity, shares in self.shares(mistakes).items()
            for column, share in enumerate(shares)
            if share > least
            and must_move(
                self._answer(drive)[quantity][:, column], self.grid, 0.0, self.noise[quantity]
            )
        ]

    def _misreadings(self, quantity: str, columns: int) -> Iterator[Misreading]:
        return misreadings(quantity, self._plant, self._rig.joints.gear, columns)

    def _right(self) -> Misreading:
        return next(self._misreadings('command', self._held.shape[1]))

    def _may_be_meant(self, drive: Misreading) -> bool:
        """Whether it moves, and either cannot be what was given or the shafts follow it."""
        if np.ptp(self._shaft(drive)[:, list(drive.touched)], axis=0).max() < MOVES_RAD:
            return False
        if np.abs(self._held).max() > self._rig.motors.reach:
            return True
        # Bending and tension of half the motion may be those of another rig.
        if 'shaft_position' not in self.measured:
            return not drive.of_gear
        followed = self._ways(drive, 'shaft_position')
        allowed = log(DERIVED.follows) * self._held.shape[1]
        return any(w.misfit <= allowed for w in followed if w.reading.kind in ('right', 'sign'))

    def _beyond_reach(self, drive: Misreading, worth: float) -> float:
        """What speaks against a command that turns shafts further than the rig lets them.

        Of bending nothing is learnt: it follows any command at some scale.
        """
        turned = np.abs(self._held[:, list(drive.source)] / np.asarray(drive.factor)).max(axis=0)
        columns = int((turned > self._rig.motors.reach).sum())
        return columns * worth * log(MOST / DERIVED.usual['shaft_position'])

    def simulated(self, command: Misreading) -> dict[str, Array]:
        """Simulate the plant on the command as it is meant."""
        shaft = self._shaft(command)
        answer = simulate(self._plant, shaft, start_shaft=shaft[0])
        every = round(PERIOD_S / TICK)
        return {
            quantity: getattr(answer, quantity).reshape(len(shaft), -1)[::every]
            for quantity in self.measured
        }

    def expected(self) -> dict[str, Array]:
        """Simulate the plant on the command as it is read."""
        return self.simulated(self._right())

    def is_noisy(self) -> bool:
        """Whether the readings have noise, as those of a simulation have not."""
        return any(
            bool((self._scatter[q] > 0.1 * self.noise[q]).any())
            for q in ('tension', 'bending')
            if q in self.measured
        )

    def _shaft(self, command: Misreading) -> Array:
        shaft = self._held[:, list(command.source)] / np.asarray(command.factor)
        return np.clip(shaft, -LARGEST_COMMAND, LARGEST_COMMAND)

    def _ways(self, command: Misreading, quantity: str) -> list[Way]:
        """All ways to read a quantity where the command is meant so."""
        if (command, quantity) not in self._known:
            answer = self._answer(command)[quantity]
            self._known[command, quantity] = self._ways_of(quantity, answer)
        return self._known[command, quantity]

    def _answer(self, command: Misreading) -> dict[str, Array]:
        if command not in self._answers:
            self._answers[command] = self.simulated(command)
        return self._answers[command]

    def _ways_of(self, quantity: str, simulated: Array) -> list[Way]:
        moments = Moments.of(self.measured[quantity], simulated)
        lowest, largest = DERIVED.scales[quantity]
        usual = DERIVED.usual[quantity]
        bounds = Bounds(
            (lowest, largest),
            TURN_RAD if quantity == 'bending' else inf,
            self.noise[quantity],
            self._scatter[quantity],
            DERIVED.least_tension if quantity == 'tension' else -inf,
        )
        misfits: dict[float, Array] = {}
        found = []
        for reading in (*self._readings[quantity], *self._of_any_size(quantity, moments)):
            misfit = []
            for column, (source, factor) in enumerate(
                zip(reading.source, reading.factor, strict=True)
            ):
                if factor not in misfits:
                    misfits[factor] = moments.misfit(factor, bounds)
                misfit.append(misfits[factor][:, source, column])
            share, scale = np.transpose(misfit)
            kept = np.log(np.clip(share, usual, MOST))
            size = np.abs(np.log(np.maximum(scale, usual))) / max(log(largest), usual)
            found.append(Way(reading, share, float(kept.sum()), float(size.sum())))
        return found

    def _of_any_size(self, quantity: str, moments: Moments) -> Iterator[Misreading]:
        """Readings of a factor that belongs to no unit: of a gear, or of a converter."""
        if quantity not in ('shaft_position', 'tension'):
            return
        size = moments.size()
        columns = len(size)
        whole = tuple(range(columns))
        parts = [whole] if quantity == 'tension' else [*((c,) for c in whole), whole]
        ways = CONVERTER_BITS * log(2.0) / DERIVED.usual[quantity]
        for part in dict.fromkeys(parts):
            factor = float(np.median(size[list(part)]))
            of_a_rig = quantity == 'tension' and 1.0 / OTHER_RIGS <= factor <= OTHER_RIGS
            if factor > 0.0 and not of_a_rig:
                many = len(parts) - 1 if len(part) < columns else 1
                yield scaled(quantity, 'factor', factor, part, columns, ways * many)


def as_meant(recording: Recording, mistakes: Collection[Misreading]) -> Recording:
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


def _prices(mistakes: list[Misreading]) -> list[float]:
    """Price of each mistake; all that a motor's messages hold is exchanged together."""
    prices = {
        (m.quantity.partition('_')[0] if m.kind == 'order' else m.quantity, m.source): m.price
        for m in mistakes
    }
    return list(prices.values())


def _span(recording: Recording) -> tuple[float, float]:
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
    return np.asarray(np.median(np.abs(bow), axis=0) / 0.6745 / np.sqrt(1.5))


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
