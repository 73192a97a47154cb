"""Readings that the described plant cannot give, but would in another unit, sign or order.

The plant is simulated on the recorded command. A reading fits a simulated signal as far as a lag,
an offset and a scale that real rigs have carry one into the other. Where one does not, all are
tried in the units, signs and orders that people take by mistake, and the command is too. A mistake
is said where it makes the whole recording fit far better. Physics that is left out changes sizes
and shapes within those tolerances, or into what no mistake explains.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf, log, pi

import numpy as np

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.on_stamps import hold_on_ticks
from endoscope_core.physics.simulator import LARGEST_COMMAND, TICK, simulate
from endoscope_core.rig import shipped_rig
from endoscope_explain.audit.misreading import Misreading, misreadings, scaled
from endoscope_explain.recording import Recording, Series
from endoscope_explain.recording.series import Array

PERIOD_S = 0.02
"""Between the samples that are compared."""
LONGEST_S = 90.0
"""Motion that is compared: ten times the shortest calibration."""
LAGS_S = (0.0, 0.02, 0.04, 0.06, 0.1, 0.14, 0.2, 0.3, 0.4, 0.5)
"""Up to the longest delay of the catalogue."""
SCALES = {
    'shaft_position': (1.0 / 1.05, 1.05),
    'shaft_velocity': (1.0 / 1.5, 1.5),
    'shaft_effort': (0.1, 200.0),
    'tension': (1.0 / 3.0, 3.0),
    'bending': (0.0, 3.0),
}
"""Least and largest scale from a simulated signal to a real one. A servo follows its command. An
effort is at most the motor's stall torque of 4.1 N m, 200 times what the nominal wires ask for.
Wires and load cells differ by a factor of 3. A joint may be held fast."""
WINDING, PUSHED_RAD = 1.2, 1.0
"""A joint bends at most this many times as far as its wires are wound up, and as much further as
loads push it."""
CELL_OFFSET_N = 1.0
"""By which a load cell may read too little: those of the recorded rig are 0.6 N off."""
LEAST = {'shaft_position': 0.03}
USUALLY_LEAST, MOST = 0.1, 3.0
"""Misfit below which a signal fits, and above which it does not fit at all: differences beyond are
no evidence."""
FOLLOWS = 0.15
"""Misfit of a shaft that follows its command, up to which a gear may be called wrong: limits of
speed and torque change its shape by more."""
WELL, HARDLY = 0.6, 0.9
"""Misfit, on the mean and at most, up to which signals may be said to be right in another unit,
sign or order."""
NOISE_COUNTS, NOISE_APART = 0.2, 100.0
"""By how much a noise unlike the sensor's counts beside the misfit, and the factor beyond which it
says no more: a simulated recording has none."""
PRICE = 1.0
"""Fall of the sum of the misfits' logarithms that each mistake must bring."""
FREE = 1.3
"""Weight of a factor that is of no known unit."""
MOST_MISTAKES = 3
MOVES = 0.01
"""Shaft angle in rad that is a motion."""


@dataclass(frozen=True)
class Judged:
    """What is said of a recording.

    Attributes
    ----------
    mistakes : tuple of Misreading
        Empty where none is beyond doubt.
    as_read, at_best : float
        Sum of the misfits' logarithms without and with them.
    """

    mistakes: tuple[Misreading, ...]
    as_read: float
    at_best: float


@dataclass(frozen=True)
class Bounds:
    """What real rigs make of a simulated quantity.

    Attributes
    ----------
    scale : (float, float)
        Least and largest one.
    reach : array (P,)
        From the lowest to the highest value that it can have.
    noise : float
        Of the sensor as described.
    scatter : array (M,)
        Of the reading from sample to sample, in its own unit.
    pulls : bool
        Whether it is the tension of a wire, which cannot push.
    """

    scale: tuple[float, float]
    reach: Array
    noise: float
    scatter: Array
    pulls: bool


@dataclass(frozen=True)
class Moments:
    """Second moments of M measured and P simulated columns, the latter at L lags.

    Attributes
    ----------
    mean, variance, reach : array (M,)
        The latter from low to high.
    simulated_mean, simulated_variance : array (L, P)
    covariance : array (L, M, P)
    """

    mean: Array
    variance: Array
    reach: Array
    simulated_mean: Array
    simulated_variance: Array
    covariance: Array

    @staticmethod
    def of(measured: Array, simulated: Array) -> 'Moments':
        """Of arrays (N, M) and (N, P) on one grid."""
        lags = [round(lag / PERIOD_S) for lag in LAGS_S]
        late = measured[lags[-1] :]
        early = np.stack([simulated[lags[-1] - lag : len(simulated) - lag] for lag in lags])
        reach = np.ptp(np.quantile(late, (0.01, 0.99), axis=0), axis=0)
        mean, simulated_mean = late.mean(axis=0), early.mean(axis=1)
        late, early = late - mean, early - simulated_mean[:, None]
        return Moments(
            mean,
            (late**2).mean(axis=0),
            reach,
            simulated_mean,
            (early**2).mean(axis=1),
            np.matmul(late.T, early) / len(late),
        )

    def misfit(self, factor: float, bounds: 'Bounds') -> Array:
        """Share of each measured column that no lag, offset and scale make of each simulated one.

        Parameters
        ----------
        factor : float
            Reading of one SI unit.
        bounds : Bounds

        Returns
        -------
        array (M, P)
            0 where they agree, 1 where they have nothing in common.
        """
        mean, variance = self.mean / factor, (self.variance / factor**2)[:, None]
        covariance, power = self.covariance / factor, self.simulated_variance[:, None, :]
        best = np.clip(covariance / np.maximum(power, 1e-300), *bounds.scale)
        left = variance - 2.0 * best * covariance + best**2 * power
        if bounds.pulls:
            highest = (1.0 + bounds.scale[1]) * self.simulated_mean[:, None, :]
            left = left + np.maximum(-CELL_OFFSET_N - mean, 0.0)[:, None] ** 2
            left = left + np.maximum(mean[:, None] - highest, 0.0) ** 2
        left = left + np.maximum((self.reach / abs(factor))[:, None] - bounds.reach, 0.0) ** 2
        # What a unit makes small must not pass for noise, unless the reading is as noisy in it.
        spread = np.full((len(mean), 1), bounds.noise)
        if abs(factor) > 1.0:
            spread = np.minimum(spread, bounds.scatter[:, None] / abs(factor))
        floor = (3.0 * spread) ** 2
        return np.asarray(np.sqrt(np.maximum(left, 0.0) / (variance + floor + 1e-300)).min(axis=0))

    def size(self) -> Array:
        """Times that each measured column is as large as its simulated one, where they agree."""
        power = np.maximum(self.simulated_variance, 1e-300)
        alike = np.einsum('lmm->lm', self.covariance) / np.sqrt(
            np.maximum(power * self.variance, 1e-300)
        )
        lag = alike.argmax(axis=0)
        column = np.arange(len(self.mean))
        return np.sqrt(self.variance / power[lag, column]) * (alike.max(axis=0) > 0.0)


class Comparison:
    """A recording beside what the described plant makes of its command.

    Parameters
    ----------
    recording : Recording
        With increasing stamps in s.
    plant : PlantDescription
        Of its joints.
    leave_out : collection of str
        Quantities that are not compared.
    """

    def __init__(
        self, recording: Recording, plant: PlantDescription, leave_out: Collection[str] = ()
    ) -> None:
        self._plant = plant
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
            quantity: tuple(misreadings(quantity, plant, values.shape[1]))
            for quantity, values in self.measured.items()
        }
        sensors = plant.sensors
        self.noise = {
            'shaft_position': 2.0 * pi / sensors.encoder_counts,
            'shaft_velocity': sensors.velocity_resolution,
            'shaft_effort': max(sensors.effort_noise, sensors.effort_resolution),
            'tension': max(sensors.load_cell_noise, sensors.load_cell_resolution),
            'bending': sensors.tracker_noise,
        }

    def judged(self) -> Judged:
        """Find the mistakes that make the recording fit far better, if any."""
        drives = tuple(misreadings('command', self._plant, self._held.shape[1]))
        costs = self._costs(drives[0])
        as_read = sum(of[0][0] for of in costs.values())
        least, best = as_read, Judged((), as_read, as_read)
        if all(fits for (_, _, fits), *_ in costs.values()):
            return best
        beyond = np.abs(self._held).max() > WINDING * shipped_rig().motors.reach
        if not beyond and costs.get('shaft_position', [(0.0, drives[0], False)])[0][2]:
            # The shaft follows: of the command only what is wrong with both can be.
            drives = tuple(drive for drive in drives if drive.kind not in ('unit', 'factor'))
        for drive in drives:
            if drive.weight:
                costs = self._costs(drive)
            if drive.weight and not self._may_be_meant(drive, costs):
                continue
            reached, said = 0.0, [drive] if drive.weight else []
            for quantity, of in costs.items():
                allowed = [
                    c
                    for c in of
                    if not (drive.of_gear and quantity == 'shaft_position' and c[1].of_gear)
                    and (c[2] or not c[1].weight)
                ]
                cost, reading, _ = min(allowed, key=lambda c: c[0] + PRICE * c[1].weight)
                reached += cost
                said += [reading] if reading.weight else []
            weights = _weights(said)
            priced = reached + PRICE * sum(weights)
            if priced < least - 1e-9 and len(weights) <= MOST_MISTAKES:
                least, best = priced, Judged(tuple(said), as_read, reached)
        return best

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
        return self.simulated(next(misreadings('command', self._plant, self._held.shape[1])))

    def is_noisy(self) -> bool:
        """Whether the readings have noise, as those of a simulation have not."""
        return any(
            bool((self._scatter[q] > 0.1 * self.noise[q]).any())
            for q in ('tension', 'bending')
            if q in self.measured
        )

    def _may_be_meant(
        self, drive: Misreading, costs: Mapping[str, list[tuple[float, Misreading, bool]]]
    ) -> bool:
        """Whether the command as it is given is impossible, or the shaft follows it as meant."""
        if np.ptp(self._shaft(drive)[:, list(drive.touched)], axis=0).max() < MOVES:
            return False
        if np.abs(self._held).max() > WINDING * shipped_rig().motors.reach:
            return True
        if 'shaft_position' in costs:
            return any(
                fits
                for _, reading, fits in costs['shaft_position']
                if reading.kind in ('right', 'sign')
            )
        # Bending and tension of half the motion may be those of another rig.
        return not drive.of_gear

    def _shaft(self, command: Misreading) -> Array:
        shaft = self._held[:, list(command.source)] / np.asarray(command.factor)
        return np.clip(shaft, -LARGEST_COMMAND, LARGEST_COMMAND)

    def _costs(self, command: Misreading) -> dict[str, list[tuple[float, Misreading, bool]]]:
        """Logarithm of the misfit of each way to read each quantity, and whether it fits well."""
        winding = [j.pulley_radius / j.joint_radius for j in self._plant.joints.values()]
        bent = WINDING * np.ptp(self._shaft(command), axis=0) * winding + PUSHED_RAD
        found: dict[str, list[tuple[float, Misreading, bool]]] = {}
        for quantity, simulated in self.simulated(command).items():
            lowest, largest = SCALES[quantity]
            if quantity == 'bending':
                # Where friction all but holds the described joint, another one may bend freely.
                largest = max(
                    largest, float((bent / np.maximum(np.ptp(simulated, axis=0), 1e-9)).max())
                )
            bounds = Bounds(
                (lowest, largest),
                bent if quantity == 'bending' else np.full(simulated.shape[1], inf),
                self.noise[quantity],
                self._scatter[quantity],
                quantity == 'tension',
            )
            moments = Moments.of(self.measured[quantity], simulated)
            misfits: dict[float, Array] = {}
            found[quantity] = []
            for reading in (*self._readings[quantity], *self._of_any_size(quantity, moments)):
                misfit = []
                for column, (source, factor) in enumerate(
                    zip(reading.source, reading.factor, strict=True)
                ):
                    if factor not in misfits:
                        misfits[factor] = moments.misfit(factor, bounds)
                    misfit.append(misfits[factor][source, column])
                judged = np.array(misfit)[list(reading.touched or range(len(misfit)))]
                if quantity == 'shaft_position' and not reading.is_beyond_reach:
                    well = bool(judged.max() < FOLLOWS)
                else:
                    mean = np.exp(np.log(judged + 1e-9).mean())
                    well = bool(mean < WELL and judged.max() < HARDLY)
                kept = np.clip(misfit, LEAST.get(quantity, USUALLY_LEAST), MOST)
                cost = float(np.log(kept).sum()) + self._noise_apart(quantity, reading)
                found[quantity].append((cost, reading, well))
        return found

    def _noise_apart(self, quantity: str, reading: Misreading) -> float:
        """How far the readings' noise is from the sensor's, where it is white."""
        if quantity not in ('tension', 'bending'):
            return 0.0
        factor = np.abs(reading.factor)
        ratio = np.maximum(self._scatter[quantity], 1e-12) / (
            factor * self.noise[quantity] + 1e-300
        )
        return float(NOISE_COUNTS * np.minimum(np.abs(np.log(ratio)), log(NOISE_APART)).sum())

    def _of_any_size(self, quantity: str, moments: Moments) -> Iterator[Misreading]:
        """Readings of a factor that belongs to no unit: of a gear, or of a converter."""
        if quantity not in ('shaft_position', 'tension'):
            return
        size = moments.size()
        columns = len(size)
        if quantity == 'tension':
            factor = float(np.median(size))
            parts = [tuple(range(columns))] if factor > 10.0 else []
        else:
            parts = [(c,) for c in range(columns)]
            if columns > 1 and np.ptp(size) < 0.02 * size.max():
                parts.append(tuple(range(columns)))
        for part in parts:
            factor = float(np.median(size[list(part)]))
            if factor > 0.0:
                one = scaled(quantity, 'factor', factor, part, columns)
                yield Misreading(
                    quantity, one.kind, FREE * one.weight, one.source, one.factor, one.unit
                )


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


def _weights(mistakes: list[Misreading]) -> list[float]:
    """Weight of each mistake; all that a motor's messages hold is exchanged together."""
    weights = {
        (m.quantity.partition('_')[0] if m.kind == 'order' else m.quantity, m.source): m.weight
        for m in mistakes
    }
    return list(weights.values())


def _span(recording: Recording) -> tuple[float, float]:
    """From shortly before the first motion, no longer than is needed."""
    command = recording.command
    away = np.abs(command.values - command.values[0]).max(axis=1) >= MOVES
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
