"""What the demonstration's recordings show, beside the first paper's figures in one table."""

import textwrap
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import Recording, open_bag
from endoscope_bringup.demo.procedure import (
    MOTION_TITLE,
    MOTIONS,
    TABLE_5,
    CalibrationFacts,
    Method,
    PaperFigure,
    RecordedRun,
)
from endoscope_core.metrics import tracking_rmse, width_at_mid_height
from endoscope_core.signals import (
    CALIBRATION_RECORD_DURATION,
    Signal,
    calibration_sinusoid,
    motion_by_name,
)
from endoscope_nodes import names

Array = NDArray[np.float64]
RMSE = 'RMSE'
LARGEST = 'largest error'
BACKLASH = 'loop width'
PAPER = ('paper, none', 'paper, proposed')
COLUMN, HEADING = 14, 3
"""Width of a column and lines of a heading in the terminal's table."""


def mean_over_joints(figure: Callable[..., float], desired: Array, actual: Array) -> float:
    """The size of a figure of desired and actual angles (N, J), in their unit."""
    pairs = zip(desired.T, actual.T, strict=True)
    return float(np.mean([abs(figure(*pair)) for pair in pairs]))


@dataclass(frozen=True)
class CalibrationOutcome:
    """One calibration: what the wires showed and what was made of it."""

    facts: CalibrationFacts  # what was announced
    time: Array  # (N,), s since the sinusoid began
    tension: Array  # (N, 4), N, in the order of `wires`
    wires: tuple[str, ...]
    tracked_at: Array  # (M,), stamps of the tracker on the same clock
    desired_deg: Array  # (M, J), commanded
    actual_deg: Array  # (M, J), tracked

    @property
    def backlash_deg(self) -> float:
        """Width of the loop at mid-height, the mean over the joints."""
        return mean_over_joints(width_at_mid_height, self.desired_deg, self.actual_deg)


@dataclass(frozen=True)
class TrackingRun:
    """One motion tracked by one method, over its steady part, at the tracker's stamps."""

    tube: str
    motion: str
    method: Method
    time: Array  # (N,), s since the motion began
    desired_deg: Array  # (N, J), asked for in this very run
    actual_deg: Array  # (N, J), as the tracker saw it

    @property
    def error_deg(self) -> Array:
        """Actual less desired angle, (N, J)."""
        return self.actual_deg - self.desired_deg

    @property
    def rmse_deg(self) -> float:
        """Root of the mean square error, the mean over the joints."""
        return mean_over_joints(tracking_rmse, self.desired_deg, self.actual_deg)

    @property
    def largest_deg(self) -> float:
        """Largest error of any joint."""
        return float(np.abs(self.error_deg).max())

    @property
    def backlash_deg(self) -> float:
        """Width of the loop at mid-height, the mean over the joints."""
        return mean_over_joints(width_at_mid_height, self.desired_deg, self.actual_deg)


@dataclass(frozen=True)
class DemoResults:
    """All that the report shows."""

    calibrations: tuple[CalibrationOutcome, ...]
    runs: tuple[TrackingRun, ...]
    noise_deg: float  # what the tracker says of a tip that rests, rms
    messages: dict[str, int]  # recorded, by topic
    lost: dict[str, int]  # missing from the recording, by topic

    def run(self, tube: str, motion: str, method: Method) -> TrackingRun:
        """The run of that tube, motion and method; KeyError if it was not made."""
        return {(r.tube, r.motion, r.method): r for r in self.runs}[tube, motion, method]


@dataclass(frozen=True)
class TableRow:
    """One figure of one motion in one tube, in degrees."""

    tube: str
    motion: str
    figure: str
    values: dict[Method, float]
    paper_none: PaperFigure | None  # on the paper's rig; None where the paper does not say
    paper_proposed: PaperFigure | None  # likewise

    def is_best(self, method: Method) -> bool:
        """Whether a method has the least figure of all, as printed."""
        return round(self.values[method], 2) == min(round(x, 2) for x in self.values.values())

    def left(self, method: Method) -> float:
        """Share of the uncompensated figure that a method leaves."""
        return self.values[method] / self.values[Method.NONE]


def table_rows(results: DemoResults) -> list[TableRow]:
    """RMSE, largest error and loop width of each tube and motion, by every method."""
    rows = []
    for calibration in results.calibrations:
        tube = calibration.facts.tube
        for motion in MOTIONS:
            rmse_none, rmse, width_none, width = TABLE_5[tube, motion]
            for figure, key, *paper in (
                (RMSE, 'rmse_deg', rmse_none, rmse),
                (LARGEST, 'largest_deg', None, None),
                (BACKLASH, 'backlash_deg', width_none, width),
            ):
                values = {m: getattr(results.run(tube, motion, m), key) for m in Method}
                rows.append(TableRow(tube, MOTION_TITLE[motion], figure, values, *paper))
    return rows


def of_figure(rows: Sequence[TableRow], figure: str) -> list[TableRow]:
    """The rows of one figure."""
    return [row for row in rows if row.figure == figure]


def values_of(rows: Sequence[TableRow], figure: str, method: Method) -> list[float]:
    """One figure in degrees by one method, in each tube and motion."""
    return [row.values[method] for row in of_figure(rows, figure)]


def ranking(rows: Sequence[TableRow]) -> list[Method]:
    """Methods by the share of the uncompensated RMSE that they leave on average, best first."""
    judged = of_figure(rows, RMSE)
    return sorted(Method, key=lambda method: sum(row.left(method) for row in judged))


def figures_table(rows: Sequence[TableRow]) -> str:
    """The table as text for a terminal, the best figure of a row marked by a star."""
    order = ranking(rows)
    columns = [textwrap.wrap(name, COLUMN - 1) for name in (*order, *PAPER)]
    lines = [
        _line('deg' if line == HEADING - 1 else '', [c[line : line + 1] or [''] for c in columns])
        for line in range(HEADING)
    ]
    for row in rows:
        if row.figure == RMSE:
            lines.append(f'{row.tube}, {row.motion}')
        marks = [f'{row.values[m]:.2f}{"*" if row.is_best(m) else " "}' for m in order]
        paper = [str(figure or '') for figure in (row.paper_none, row.paper_proposed)]
        lines.append(_line('  ' + row.figure, [[cell] for cell in (*marks, *paper)]))
    return '\n'.join(line.rstrip() for line in lines)


def _line(title: str, cells: Sequence[Sequence[str]]) -> str:
    return f'{title:16s}' + ''.join(f'{cell[0]:>{COLUMN}s}' for cell in cells)


REST_S = 0.5
"""Before a run, in which nothing has moved for some time."""

LATEST_START_S = 3.0


def analyse(
    bags: dict[str, Path],
    segments: Sequence[RecordedRun],
    calibrations: Sequence[CalibrationFacts],
    lost: dict[str, int],
) -> DemoResults:
    """Figures of all runs, from the recordings alone; `lost` is what recorders missed, by topic."""
    recordings = {tube: open_bag(path) for tube, path in bags.items()}
    angles = {tube: Angles.of(recording) for tube, recording in recordings.items()}
    messages: Counter[str] = Counter()
    for recording in recordings.values():
        messages.update({name: topic.message_count for name, topic in recording.topics.items()})
    return DemoResults(
        tuple(
            _calibration(recordings[facts.tube], angles[facts.tube], facts)
            for facts in calibrations
        ),
        tuple(run_of(angles[s.tube], s) for s in segments),
        _noise(angles, segments),
        dict(sorted(messages.items())),
        lost,
    )


@dataclass(frozen=True)
class Angles:
    """What was asked of the joints of one tube and what the tracker saw, s and rad."""

    time: Array  # (N,)
    actual: Array  # (N, J)
    asked_time: Array  # (M,)
    asked: Array  # (M, J)

    @classmethod
    def of(cls, recording: Recording) -> 'Angles':
        """Those of a recording."""
        actual = recording.joint_state(names.SLAVE_MEASURED).select(names.JOINTS)
        asked = recording.joint_state(names.SLAVE_COMMAND).select(names.JOINTS)
        return cls(
            actual.seconds(0),
            actual.require('position'),
            asked.seconds(0),
            asked.require('position'),
        )

    def between(self, start: float, end: float) -> 'Angles':
        """Those of an interval, its start at 0 s."""
        tracked = (self.time >= start) & (self.time < end)
        asked = (self.asked_time >= start) & (self.asked_time < end)
        return Angles(
            self.time[tracked] - start,
            self.actual[tracked],
            self.asked_time[asked] - start,
            self.asked[asked],
        )

    @property
    def desired(self) -> Array:
        """What was asked for at the tracker's stamps, (N, J)."""
        columns = [np.interp(self.time, self.asked_time, asked) for asked in self.asked.T]
        return np.column_stack(columns)


def run_of(angles: Angles, segment: RecordedRun) -> TrackingRun:
    """The steady part of a run, beside what was asked for."""
    own = angles.between(segment.start, segment.end)
    signal = motion_by_name(segment.motion).joints[names.JOINTS[0]]
    began = start_of_motion(own.asked_time, own.asked[:, 0], signal)
    if own.asked_time[-1] < began + signal.steady[1]:
        raise ValueError(
            f'{segment.tube}, {segment.motion}, {segment.method}: it began {began:.1f} s late and '
            'was not tracked to its end'
        )
    time = own.time - began
    inside = (time >= signal.steady[0]) & (time <= signal.steady[1])
    return TrackingRun(
        segment.tube,
        segment.motion,
        segment.method,
        time=time[inside],
        desired_deg=np.degrees(own.desired[inside]),
        actual_deg=np.degrees(own.actual[inside]),
    )


def start_of_motion(time: Array, desired: Array, signal: Signal) -> float:
    """When, in s to a ms, a motion began in what was asked for: `desired` (N,), rad."""
    # The way to the motion from the measured pose comes first.
    late = np.flatnonzero(time >= LATEST_START_S)[::10]
    least, most = desired[late].min(), desired[late].max()

    def misfit(start: float) -> float:
        # What was asked for is the signal, cut where the bending range of the tube ends.
        asked = np.clip(signal(time[late] - start)[0], least, most)
        return float(np.sum((asked - desired[late]) ** 2))

    coarse = min(np.arange(0.0, LATEST_START_S, 0.02), key=misfit)
    return float(min(np.arange(coarse - 0.02, coarse + 0.02, 0.001), key=misfit))


def _noise(angles: dict[str, Angles], segments: Sequence[RecordedRun]) -> float:
    """Of the tracker in degrees, rms, from the rests before the runs."""
    rests = [angles[s.tube].between(s.start - REST_S, s.start).actual for s in segments]
    return float(np.degrees(np.sqrt(np.mean([np.var(rest, axis=0, ddof=1) for rest in rests]))))


def _calibration(
    recording: Recording, angles: Angles, facts: CalibrationFacts
) -> CalibrationOutcome:
    wires = recording.joint_state(names.WIRES_MEASURED)
    wire_time = wires.seconds(0) - facts.start
    recorded = (wire_time >= 0) & (wire_time < CALIBRATION_RECORD_DURATION)
    own = angles.between(facts.start, facts.start + CALIBRATION_RECORD_DURATION)
    signal = calibration_sinusoid()
    steady = own.time >= signal.steady[0]
    desired = np.degrees(signal(own.time[steady])[0])
    return CalibrationOutcome(
        facts,
        wire_time[recorded],
        wires.require('effort')[recorded],
        wires.names,
        own.time[steady],
        np.column_stack([desired] * len(names.JOINTS)),
        np.degrees(own.actual[steady]),
    )
