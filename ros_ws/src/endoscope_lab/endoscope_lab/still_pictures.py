"""Plots of documentation and benchmarks: one style for all figures of matplotlib."""

import io
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

Array = NDArray[np.float64]

INK = '#1f2933'
GRID = '#d9dee4'
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


def svg(figure: Figure) -> str:
    """Return a figure as an `<svg>` element for a page."""
    text = io.StringIO()
    figure.savefig(text, format='svg', metadata={'Date': None})
    content = text.getvalue()
    return content[content.index('<svg') :]


def thinned(*columns: Array) -> tuple[Array, ...]:
    """Thin columns (N,) of equal length alike, so that a page stays small."""
    step = max(1, int(np.ceil(len(columns[0]) / MOST_POINTS)))
    return tuple(column[::step] for column in columns)
