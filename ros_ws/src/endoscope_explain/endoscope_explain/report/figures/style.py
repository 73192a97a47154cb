"""One look for all plots of the report."""

import io
from typing import Any

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
    'svg.fonttype': 'none',
    'svg.hashsalt': 'endoscope',
}


def svg(figure: Figure) -> str:
    """Return a figure as an `<svg>` element that can stand in a page."""
    text = io.StringIO()
    figure.savefig(text, format='svg', metadata={'Date': None})
    content = text.getvalue()
    return content[content.index('<svg') :]


def thinned(*columns: Array, most: int = MOST_POINTS) -> tuple[Array, ...]:
    """Thin columns of equal length alike, so that a page stays small.

    Parameters
    ----------
    *columns : array (N,)
    most : int
        Largest number of points.

    Returns
    -------
    tuple of array (M,)
    """
    step = max(1, int(np.ceil(len(columns[0]) / most)))
    return tuple(column[::step] for column in columns)
