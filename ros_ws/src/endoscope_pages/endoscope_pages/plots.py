"""Plots in a self-contained page that can be zoomed, moved and read out with the cursor.

Without JavaScript, and for readers who cannot see the plots, each figure has a table of numbers.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_pages.page import html_table

Array = NDArray[np.float64]

MOST_READINGS = 4000
"""A curve of more readings is drawn as a band of their least and greatest values."""

MOST_BINS = 2000
COLUMNS = 12
_HINT = (
    '<span class="by-mouse">Drag to zoom, Shift and drag to move, double click to see all.</span>'
    '<span class="by-touch">Two fingers zoom, one moves.</span>'
)
_NOT_DRAWN = (
    '<p class="note plot-none">Without JavaScript no curves are drawn. Their numbers are in the '
    'table.</p>'
)
_AS_GIVEN = ('x_label', 'height', 'loop', 'square', 'log', 'level', 'diagonal', 'shaded', 'marks')
_NUMBERS = ('plot', 'curve', 'values', 'least', 'greatest', 'mean', 'root mean square')
_ACTIONS = (
    ('all', 'all', 'show all'),
    ('left', '‹', 'move left'),
    ('right', '›', 'move right'),
    ('out', '−', 'zoom out'),
    ('in', '+', 'zoom in'),
)


def banded(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Edges (K + 1,) of stretches of x (N,), increasing, and least and greatest y (K,) in each."""
    # Neighbours share a reading, so that the band is as connected as the line through all readings,
    # and none of these lies outside. NaN in y is left out; a stretch of nothing else is NaN.
    step = math.ceil((len(y) - 1) / MOST_BINS)
    begins = np.arange(0, len(y) - 1, step)
    ends = np.minimum(begins + step, len(y) - 1)
    low = np.fmin(np.fmin.reduceat(y, begins), y[ends])
    high = np.fmax(np.fmax.reduceat(y, begins), y[ends])
    return np.append(x[begins], x[-1]), low, high


def decimated(x: Array, y: Array) -> NDArray[np.intp]:
    """Indices of the first, last, least and greatest readings of each stretch of a loop in time."""
    step = math.ceil(2 * len(y) / MOST_READINGS)
    while len(kept := _extremes(x, y, step)) > MOST_READINGS:
        step += math.ceil(step / 4)
    return kept


def _extremes(x: Array, y: Array, step: int) -> NDArray[np.intp]:
    kept = {len(y) - 1}
    for begin in range(0, len(y), step):
        end = min(begin + step, len(y))
        kept |= {begin, end - 1}
        for values in (x[begin:end], y[begin:end]):
            known = np.flatnonzero(np.isfinite(values))
            if len(known):
                kept |= {
                    begin + int(known[np.argmin(values[known])]),
                    begin + int(known[np.argmax(values[known])]),
                }
    return np.array(sorted(kept))


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of a plot.

    Attributes
    ----------
    label : str
        Its name in the legend.
    x : NDArray, shape (N,) or (N + 1,)
        Where the values are, in the plot's unit, increasing unless the plot is a loop; N + 1
        elements are the edges of the stretches in each of which a value holds.
    y : NDArray, shape (N,)
        Values in the plot's unit; NaN leaves a gap.
    colour : str
        A variable of look.css without its dashes.
    width : float
        Of the line, px.
    dash : tuple of float
        Lengths of strokes and gaps, px; none for a solid line.
    low, high : NDArray, shape (N,), optional
        A band around the curve.
    time : NDArray, shape (N,), optional
        In s, of points of a loop: what part of it another plot shows.
    to : str
        Label of another curve of the plot with the same `x`; the area between them is filled.
    """

    label: str
    x: Array
    y: Array
    colour: str = 'actual'
    width: float = 1.4
    dash: tuple[float, ...] = ()
    low: Array | None = None
    high: Array | None = None
    time: Array | None = None
    to: str = ''

    def __post_init__(self) -> None:
        count = len(self.y)
        if len(self.x) not in (count, count + 1) or not count:
            raise ValueError(
                f'curve {self.label!r} has {count} values at {len(self.x)} places: '
                'give one place for each value, or the edges of their stretches'
            )
        for name in ('low', 'high', 'time'):
            other = getattr(self, name)
            if other is not None and len(other) != count:
                raise ValueError(f'curve {self.label!r}: {name} has {len(other)}, not {count}')


@dataclass(frozen=True, eq=False)
class Plot:
    """One plot of a figure.

    Attributes
    ----------
    title : str
        What is drawn, with its unit.
    x_label : str
        What is across, with its unit; plots of a figure that name the same zoom together.
    curves : tuple of Curve
        What is drawn.
    columns : int
        Width, of the figure's twelve columns.
    height : int
        Of the drawing without its axis, px.
    loop : bool
        Whether the curves run back and forth in `x`.
    square : bool
        Whether it is as high as it is wide.
    range_x, range_y : tuple of float, optional
        What is seen at first, in the units of the axes; by default all.
    log : bool
        Whether values are drawn by their logarithm.
    level : tuple of float and str, optional
        A value that a dotted line marks, and its word.
    diagonal : bool
        Whether a dotted line marks where both axes have the same value.
    shaded : tuple of pairs of float
        Highlighted intervals of `x`.
    marks : tuple of float
        Highlighted places on `x`.
    """

    title: str
    x_label: str
    curves: tuple[Curve, ...]
    columns: int = COLUMNS
    height: int = 180
    loop: bool = False
    square: bool = False
    range_x: tuple[float, float] | None = None
    range_y: tuple[float, float] | None = None
    log: bool = False
    level: tuple[float, str] | None = None
    diagonal: bool = False
    shaded: tuple[tuple[float, float], ...] = ()
    marks: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        for curve in self.curves:
            if self.loop and curve.time is None:
                raise ValueError(f'curve {curve.label!r} of a loop needs the time of its points')


def figure_html(plots: Sequence[Plot], caption: str = '') -> str:
    """Return plots that belong together, row by row, as a `<figure>`.

    Parameters
    ----------
    plots : sequence of Plot
        In the order of reading; a plot that does not fit into a row begins the next one.
    caption : str, optional
        Below them, escaped here.

    Returns
    -------
    str
        HTML that needs the scripts of a page by `render_page` to be drawn.
    """
    places: dict[bytes, int] = {}
    kept: list[list[float | None]] = []

    def place_of(x: Array) -> int:
        key = x.tobytes()
        if key not in places:
            places[key] = len(kept)
            kept.append(_rounded(x))
        return places[key]

    specs = [
        _spec(plot, place_of, labelled)
        for plot, labelled in zip(plots, _lowest(plots), strict=True)
    ]
    data = json.dumps({'x': kept, 'plots': specs}, separators=(',', ':'), allow_nan=False)
    data = data.replace('<', '\\u003c')  # so that no label ends the <script> element
    return '\n'.join(
        [
            '<figure class="plots">',
            *(_plot_html(plot) for plot in plots),
            _tools(),
            _NOT_DRAWN,
            f'<figcaption>{escape(caption)}</figcaption>' if caption else '',
            _numbers(plots),
            f'<script type="application/json" class="plot-data">{data}</script>',
            '</figure>',
        ]
    )


def _rounded(values: Array) -> list[float | None]:
    """Round to a hundred-thousandth of their range, or of each value where they are powers."""
    known = values[np.isfinite(values)]
    span = float(np.ptp(known)) if len(known) else 0.0
    decimals = 5 - math.floor(math.log10(span)) if span > 0.0 else 6
    return [round(float(v), decimals) + 0.0 if math.isfinite(v) else None for v in values]


def _range(values: Sequence[Array], margin: float, *, log: bool = False) -> list[float]:
    known = np.concatenate([v[np.isfinite(v)] for v in values])
    if not len(known):
        return [0.0, 1.0]
    low, high = float(known.min()), float(known.max())
    if log:
        return [low / 1.2, high * 1.2]
    wide = (high - low) or abs(high) or 1.0
    return [low - margin * wide, high + margin * wide]


def _spec(plot: Plot, place_of: Any, labelled: bool) -> dict[str, Any]:
    """Input of the page's drawing script."""
    labels = [curve.label for curve in plot.curves]
    values = [v for c in plot.curves for v in (c.y, c.low, c.high) if v is not None]
    return {
        **{name: getattr(plot, name) for name in _AS_GIVEN},
        'labelled': labelled,
        'range_x': plot.range_x or _range([c.x for c in plot.curves], 0.03 if plot.loop else 0.0),
        'range_y': plot.range_y or _range(values, 0.06, log=plot.log),
        'curves': [_curve(plot, curve, place_of, labels) for curve in plot.curves],
    }


def _curve(plot: Plot, curve: Curve, place_of: Any, labels: list[str]) -> dict[str, Any]:
    drawn: dict[str, Any] = {
        'colour': curve.colour,
        'width': curve.width,
        'dash': curve.dash,
        'to': labels.index(curve.to) if curve.to else None,
    }
    x, y, time = curve.x, curve.y, curve.time
    if len(y) > MOST_READINGS and plot.loop:
        kept = decimated(x, y)
        x, y, time = x[kept], y[kept], None if time is None else time[kept]
    elif len(y) > MOST_READINGS and not curve.to and curve.low is None:
        edges, low, high = banded(x, y)
        return drawn | {'x': place_of(edges), 'low': _rounded(low), 'high': _rounded(high)}
    drawn |= {'x': place_of(x), 'y': _rounded(y)}
    if time is not None:
        drawn['t'] = place_of(time)
    for name, band in (('low', curve.low), ('high', curve.high)):
        if band is not None:
            drawn[name] = _rounded(band)
    return drawn


def _lowest(plots: Sequence[Plot]) -> list[bool]:
    """Lowest plots of each column with a common horizontal axis."""
    begins, at = [], 0
    for plot in plots:
        if at + plot.columns > COLUMNS:
            at = 0
        begins.append(at)
        at += plot.columns
    keys = [(begin, plot.x_label) for begin, plot in zip(begins, plots, strict=True)]
    return [key not in keys[k + 1 :] for k, key in enumerate(keys)]


def _plot_html(plot: Plot) -> str:
    keys = ''.join(
        f'<button type="button" class="plain plot-key" aria-pressed="true">{_swatch(curve)}'
        f'{escape(curve.label)}</button>'
        for curve in plot.curves
    )
    return (
        f'<div class="plot" style="grid-column: span {plot.columns}" tabindex="0" role="group" '
        f'aria-label="{escape(plot.title)} against {escape(plot.x_label)}. Arrows read it out, '
        'plus and minus zoom, Shift and arrows move, 0 shows all.">'
        f'<div class="plot-head"><h3>{escape(plot.title)}</h3>{keys}</div>'
        '<div class="plot-canvas"></div></div>'
    )


def _swatch(curve: Curve) -> str:
    dash = ' '.join(f'{length:g}' for length in curve.dash)
    return (
        '<svg viewBox="0 0 24 8" aria-hidden="true"><line x1="0" y1="4" x2="24" y2="4" '
        f'style="stroke: var(--{curve.colour})" stroke-width="{max(curve.width, 2.0):g}"'
        + (f' stroke-dasharray="{dash}"' if dash else '')
        + '/></svg>'
    )


def _tools() -> str:
    buttons = ''.join(
        f'<button type="button" class="plain" data-do="{do}" title="{words}" '
        f'aria-label="{words}"{" disabled" if do in ("left", "right", "all") else ""}>{sign}'
        '</button>'
        for do, sign, words in _ACTIONS
    )
    return f'<div class="plot-tools">{_HINT}{buttons}</div>'


def _numbers(plots: Sequence[Plot]) -> str:
    """The table with the numbers of the plots."""
    rows = (
        (plot.title, curve.label, *_figures_of(curve.y)) for plot in plots for curve in plot.curves
    )
    return f'<details><summary>Numbers</summary>{html_table(_NUMBERS, rows, words=2)}</details>'


def _figures_of(values: Array) -> list[str]:
    known = values[np.isfinite(values)]
    if not len(known):
        return ['0', '', '', '', '']
    figures = (known.min(), known.max(), known.mean(), np.sqrt(np.mean(known**2)))
    return [str(len(known)), *(f'{v:.4g}' for v in figures)]
