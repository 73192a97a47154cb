"""The demonstration's figures beside the first paper's, in one table for page and terminal."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from endoscope_bringup.demo.procedure import (
    MOTION_TITLE,
    MOTIONS,
    TABLE_5,
    Method,
    PaperFigure,
)
from endoscope_bringup.demo.results import DemoResults

RMSE = 'RMSE'
LARGEST = 'largest error'
BACKLASH = 'loop width'

PAPER = ('paper, none', 'paper, proposed')
COLUMN, HEADING = 14, 3
"""Width of a column and lines of a heading in the terminal's table."""


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
            runs = {method: results.run(tube, motion, method) for method in Method}
            paper = TABLE_5[tube, motion]
            figures = {
                RMSE: ({m: run.rmse_deg for m, run in runs.items()}, *paper[:2]),
                LARGEST: ({m: run.largest_deg for m, run in runs.items()}, None, None),
                BACKLASH: ({m: run.backlash_deg for m, run in runs.items()}, *paper[2:]),
            }
            rows += [TableRow(tube, MOTION_TITLE[motion], f, *x) for f, x in figures.items()]
    return rows


def of_figure(rows: Sequence[TableRow], figure: str) -> list[TableRow]:
    """The rows of one figure."""
    return [row for row in rows if row.figure == figure]


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
