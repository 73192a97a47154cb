"""Real recordings on a real clock, in SI units, as `explain` takes them.

Files have 7 to 10 columns. Their meaning was derived from the numbers and the rig's program
(nhoyh, hysteresis_compensation_ROS). The phase counts loops of the program and is not a clock: a
loop takes 22.75 ms for the tubes, else 1.087 ms. The tracker gives a value every 25 ms; tensions
are a mean of five loops of a bridge that is read every 50 ms.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_core.errors import EndoscopeError
from endoscope_core.physics.description import JointParameters, PlantDescription, SensorParameters
from endoscope_core.rig import shipped_rig
from endoscope_explain.observe.observation import JointObservation, observe, with_held_noise
from endoscope_explain.recording import BENDING, COMMAND, WIRES, RigRecording, Series
from endoscope_lab.identification.family_fit import DESIRED, PHASE
from endoscope_lab.papers.real_recordings import without_repeats

Array = NDArray[np.float64]

JOINT = 'bend_x'
TUBES = ('0', '60', '120', '180', '240')
STATE, OTHERS, TIGHTENED = 'conf0_60', ('conf0_50', 'conf0_70'), 'conf0_60_'
"""Another state of the rig; the same at other amplitudes; the same tightened again."""
UNKNOWN_TUBES = ('odd_test', 'scnn_test', 'output', 'ff', 'aurora_ff')
NAMES = (*TUBES, STATE, *OTHERS, TIGHTENED, *UNKNOWN_TUBES)
KGF = 9.80665
"""N; the likely unit of the load cells of files of ten columns."""
CYCLE = 2.0 * np.pi
COARSE = 5
"""Ticks of 1 ms in one of the simulations: the motor's command changes every 23 ms at most."""
STEP = 1e-3
"""rad; near zero the tracker's angle moves in such steps."""
SAME = 0.02
"""Largest rms difference of repeated commands, rad."""
BRIDGE_S, MEAN_LOOPS = 0.05, 5
_PHASE_DIGITS = 1e-4


@dataclass(frozen=True)
class Take:
    """One recording, M values of the tracker."""

    name: str
    cycle_s: float  # of the phase
    time: Array  # (N,), s
    command: Array  # (N,), desired bending in rad, in force until the next one
    seen: Array  # (M,), when the tracker gave a new value, s
    angle: Array  # (M,), rad
    tension: Array | None  # (M, 2), N
    latency_s: float  # age of tensions in their rows

    def until(self, end: float) -> 'Take':
        """The first `end` seconds."""
        now, read = self.time < end, self.seen < end
        return replace(
            self,
            time=self.time[now],
            command=self.command[now],
            seen=self.seen[read],
            angle=self.angle[read],
            tension=None if self.tension is None else self.tension[read],
        )

    def recording(self) -> RigRecording:
        """The recording for `explain`, with stamps of tensions corrected for their latency."""
        tension = np.full((len(self.seen), 2), np.nan) if self.tension is None else self.tension
        return RigRecording(
            self.name,
            0.0,
            (JOINT,),
            Series.of(COMMAND, self.time, shipped_rig().joints.gear * self.command[:, None]),
            Series.of(WIRES, self.seen - self.latency_s, tension[:, None, :]),
            Series.of(BENDING, self.seen, self.angle[:, None]),
        )

    def observation(self) -> JointObservation:
        """The analysis view, with the noise that third differences of the readings show."""
        sensors = SensorParameters(
            load_cell_noise=0.02 if self.tension is None else _noise(self.tension),
            tracker_noise=float(np.hypot(_noise(self.angle), STEP / np.sqrt(12.0))),
        )
        plant = PlantDescription({JOINT: JointParameters()}, sensors)
        (observation,) = with_held_noise(observe(self.recording(), plant))
        return observation.coarser(COARSE)


def require_recordings(folder: Path) -> None:
    """Raise an EndoscopeError that names the recordings which a folder lacks, if any."""
    lacking = [name for name in NAMES if not (folder / f'{name}.txt').is_file()]
    if lacking:
        raise EndoscopeError(f'{folder}: lacks {", ".join(f"{n}.txt" for n in lacking)}')


def read(path: Path) -> Take:
    """Read a recording; ValueError if the file has none of the known layouts."""
    # One file ends with an empty line of blanks.
    table = np.genfromtxt(path, delimiter=',', invalid_raise=False)
    columns = table.shape[1]
    if columns not in (7, 8, 9, 10):
        raise ValueError(f'{path}: {columns} columns: recordings have 7 to 10')
    steps = np.round(np.abs(np.diff(table[:, PHASE])) / _PHASE_DIGITS).astype(int)
    # The phase falls back where a program ends; all other steps are counted loops.
    step = np.gcd.reduce(steps[steps < np.pi / _PHASE_DIGITS]) * _PHASE_DIGITS
    loop = 0.02275 if columns == 8 else 0.001087
    table, time = _on_a_clock(table, loop / step)
    command, angle, tension = table[:, DESIRED], table[:, 5], None
    if columns == 8:
        angle, tension = table[:, 3], table[:, 4:6]
    elif columns == 10:
        tension = KGF * table[:, 6:8]
    elif np.any(table[:, 6]):
        # Under feed-forward the motor is sent another angle than the desired one.
        command = table[:, 6]
    new = np.flatnonzero(np.r_[True, np.diff(angle) != 0.0])
    return Take(
        path.stem,
        CYCLE * loop / step,
        time,
        np.deg2rad(command),
        time[new],
        np.deg2rad(angle[new]),
        None if tension is None else tension[new],
        0.5 * BRIDGE_S + 0.5 * (MEAN_LOOPS - 1) * loop,
    )


def _on_a_clock(table: Array, seconds: float) -> tuple[Array, Array]:
    """Rows that do not repeat the last one, and their times in s."""
    # When the command stops, so does the phase; from there on, rows are counted at their mean time.
    moving = int(np.flatnonzero(np.diff(table[:, DESIRED]))[-1]) + 1
    time = seconds * table[:, PHASE]
    time[moving:] = time[moving - 1] * np.arange(moving + 1, len(table) + 1) / moving
    whole = np.column_stack([table, time - time[0]])
    whole = np.vstack([without_repeats(whole[:moving]), whole[moving:]])
    return whole[:, :-1], whole[:, -1]


def _noise(values: Array) -> float:
    """Rms of white noise by third differences, which remove smooth signals; robust to slips."""
    # A third difference has 20 times the variance (von Neumann et al., Ann. Math. Stat. 12, 1941).
    return float(1.4826 * np.median(np.abs(np.diff(values, 3, axis=0))) / np.sqrt(20.0))


def between_cycles(take: Take) -> tuple[float, ...]:
    """Rms between cycles: angle in rad, then tensions in N; nan if the command does not repeat."""
    first = take.command[take.time < take.cycle_s]
    moving = float(take.time[np.flatnonzero(np.diff(take.command))[-1]])
    begin, end = float(take.time[np.argmax(np.abs(first))]), moving - take.cycle_s
    at = take.seen[(take.seen > begin) & (take.seen < end)]

    def apart(time: Array, values: Array) -> float:
        once, again = (np.interp(at + late, time, values) for late in (0.0, take.cycle_s))
        return float(np.sqrt(np.mean((once - again) ** 2)))

    signals = [take.angle] if take.tension is None else [take.angle, *take.tension.T]
    repeats = apart(take.time, take.command) < SAME
    return tuple(apart(take.seen, s) if repeats else np.nan for s in signals)
