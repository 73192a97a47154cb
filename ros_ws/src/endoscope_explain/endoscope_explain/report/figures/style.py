"""One look for all plots of the report."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from endoscope_explain.report.numbers import MODELS

Array = NDArray[np.float64]

INK = '#1f2933'
GRID = '#d9dee4'
GUILTY = '#b3261e'
SHADE = '#fbe3df'
RUNG_COLOUR = {
    'measured': INK,
    'nominal': '#c2571a',
    'refitted': '#2f6fb7',
    'augmented': '#1a8a66',
    'gaussian_process': '#8a6fb0',
    'neural_network': '#b08d2f',
}
RUNG_STYLE = {'measured': '-', 'nominal': '-', 'refitted': '--', 'augmented': '-.'}
"""Dashes let a curve that nearly coincides with another one be seen."""
RUNG_TITLE = {'measured': 'measured', **MODELS}
MOST_POINTS = 1200

STYLE: dict[Any, Any] = {
    'font.size': 9.0,
    'font.family': 'sans-serif',
    'axes.edgecolor': '#9aa5b1',
    'axes.labelcolor': INK,
    'axes.titlesize': 9.5,
    'axes.titleweight': 'bold',
    'axes.titlelocation': 'left',
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.grid': True,
    'grid.color': GRID,
    'grid.linewidth': 0.6,
    'xtick.color': INK,
    'ytick.color': INK,
    'legend.frameon': False,
    'legend.fontsize': 8.0,
    'svg.fonttype': 'none',
    'svg.hashsalt': 'endoscope',
}


ABOVE: dict[str, Any] = {'loc': 'lower right', 'bbox_to_anchor': (1.0, 1.0)}
"""Where a legend hides no curve."""


@contextmanager
def page_figure(height: float) -> Iterator[Figure]:
    """A figure as wide as the page, `height` inches high."""
    with matplotlib.rc_context(STYLE):
        yield Figure(figsize=(9.6, height), layout='constrained')


def look(name: str) -> dict[str, Any]:
    """How the curve of a model, or of what was measured, is drawn."""
    return {
        'color': RUNG_COLOUR[name],
        'label': RUNG_TITLE[name],
        'linestyle': RUNG_STYLE[name],
    }


def svg(figure: Figure) -> str:
    """Return a figure as an `<svg>` element that can stand in a page."""
    text = io.StringIO()
    figure.savefig(text, format='svg', metadata={'Date': None})
    content = text.getvalue()
    return content[content.index('<svg') :]


def thinned(*columns: Array) -> tuple[Array, ...]:
    """Thin columns (N,) of equal length alike, so that a page stays small."""
    step = max(1, int(np.ceil(len(columns[0]) / MOST_POINTS)))
    return tuple(column[::step] for column in columns)
