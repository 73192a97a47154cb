"""One printed line of a table: the papers' figure, ours, and the aim."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from endoscope_core.signals import SINUSOID


@dataclass(frozen=True)
class PapersBench:
    """Settings of every table of the bench."""

    seed: int  # of tubes, rigs and noise
    tubes: int  # tube configurations for each row, at least five
    report: Callable[[str], None]  # takes a line of progress
    motion: str = SINUSOID  # of a calibration, in the tables of load cells
    weights: Path | None = None  # of the classifier there; None for the shipped ones


@dataclass(frozen=True)
class Figure:
    """One figure."""

    name: str  # what is measured, with its unit
    values: Sequence[float]  # ours, one for each tube configuration (or fold, or recording)
    paper: str = ''  # the papers' figure as they print it; empty where they have none
    at_most: float | None = None  # limit of the mean of `values`
    at_least: float | None = None  # limit of the mean of `values`
    digits: int = 2  # after the point
    note: str = ''  # needed to interpret the figure

    @property
    def reached(self) -> bool | None:
        """Whether the aim is reached; None without an aim. A mean that is not finite misses it."""
        if self.at_most is None and self.at_least is None:
            return None
        mean = float(np.mean(self.values))
        return (self.at_most is None or mean <= self.at_most) and (
            self.at_least is None or mean >= self.at_least
        )

    @property
    def ours(self) -> str:
        """Mean and standard deviation."""
        mean, spread = np.mean(self.values), np.std(self.values)
        if len(self.values) == 1:
            return f'{mean:.{self.digits}f}'
        return f'{mean:.{self.digits}f} ± {spread:.{self.digits}f}'

    @property
    def aim(self) -> str:
        """The aim in words; empty without an aim."""
        parts = []
        if self.at_least is not None:
            parts.append(f'≥ {self.at_least:g}')
        if self.at_most is not None:
            parts.append(f'≤ {self.at_most:g}')
        return ' and '.join(parts)


def table_text(rows: Sequence[Figure]) -> str:
    """Rows in columns: figure, paper, ours, number of values, aim and whether it is reached."""
    cells = [('figure', 'paper', 'ours (mean ± sd)', 'n', 'aim', '')]
    for row in rows:
        verdict = {None: '', True: 'kept', False: 'MISSED'}[row.reached]
        cells.append((row.name, row.paper or '-', row.ours, str(len(row.values)), row.aim, verdict))
    widths = [max(len(line[k]) for line in cells) for k in range(len(cells[0]))]
    lines = [
        '  '.join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in cells
    ]
    notes = list(dict.fromkeys(row.note for row in rows if row.note))
    return '\n'.join([*lines, *(f'  {note}' for note in notes)])
