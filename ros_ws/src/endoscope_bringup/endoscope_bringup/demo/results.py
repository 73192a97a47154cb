"""What was measured in the demonstration, beside the first paper's figures in one table."""

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_bringup.demo.procedure import (
    MOTION_TITLE,
    MOTIONS,
    TABLE_5,
    CalibrationFacts,
    Method,
    PaperFigure,
)
from endoscope_core.metrics import tracking_rmse, width_at_mid_height

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
