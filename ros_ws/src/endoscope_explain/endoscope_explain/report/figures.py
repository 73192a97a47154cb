"""The ladder of fits, the proposed motion and the missing function, in the colours of the page."""

import math
from html import escape
from typing import Any

import numpy as np

from endoscope_explain.case import Ladder, NextExperiment
from endoscope_explain.explanation import NINETY_PERCENT, UnknownTerm
from endoscope_explain.recording import Array
from endoscope_explain.report.numbers import PLANTS, digits, in_degrees
from endoscope_explain.report.sentences import LEAST_SHARE, plain
from endoscope_pages import Curve, Plot, figure_html

TIME = 'time (s)'

COLOUR = {
    'measured': 'actual',
    'nominal': 'curve-2',
    'refitted': 'curve-1',
    'augmented': 'curve-4',
}
"""Names of look.css."""

DASH: dict[str, tuple[float, ...]] = {
    'measured': (),
    'nominal': (),
    'refitted': (6.0, 4.0),
    'augmented': (9.0, 3.0, 2.0, 3.0),
}
"""Dashes let a curve that nearly coincides with another one be seen."""

LABEL = {'measured': 'measured', **PLANTS}


def look(name: str) -> dict[str, Any]:
    """How the curve of a model, or of what was measured, is drawn."""
    return {'label': LABEL[name], 'colour': COLOUR[name], 'dash': DASH[name]}


PREFIXED = ('N', 'm', 's')
"""What a unit that takes a prefix begins with: a force, a length or a time."""
LEAST_READABLE = 0.1
"""Of the largest value of an axis."""


def experiment_figure(experiment: NextExperiment) -> str:
    """Plot the proposed motion."""
    time = np.array(experiment.time)
    angle = np.degrees(np.array(experiment.command))
    curves = tuple(
        Curve(joint, time, angle[:, k], 'wanted' if joint == experiment.joint else 'reference')
        for k, joint in enumerate(experiment.joints)
    )
    return figure_html([Plot('command (deg)', TIME, curves, height=130)])


def unknown_figure(term: UnknownTerm) -> str:
    """Plot the missing function and those that multiply it, with 90 % bands, and a near formula."""
    every = (term, *term.factors)
    return figure_html([_function(one, columns=12 // len(every)) for one in every])


def _function(term: UnknownTerm, columns: int) -> Plot:
    argument = term.there.argument
    whole = term.multiplies or term.there.is_factor
    unit, across = _readable(argument.unit, term.nodes)
    of, up = ('', 1.0) if whole else _readable(term.there.unit, term.values)

    def drawn(values: Array) -> Array:
        if term.multiplies:
            return 1.0 + values
        return np.exp(values) if term.there.is_factor else up * values

    band = NINETY_PERCENT * term.deviation
    nodes = across * term.nodes
    curves = [
        Curve(
            'function, with 90 % band',
            nodes,
            drawn(term.values),
            width=1.8,
            low=drawn(term.values - band),
            high=drawn(term.values + band),
        )
    ]
    if term.formula_share >= LEAST_SHARE:
        colour = COLOUR['augmented']
        # A constant is the plant's numbers as well, and no recording shows how much of it is where.
        level = np.median(term.values - term.formula)
        curves.append(Curve('formula', nodes, drawn(term.formula + level), colour, dash=(6.0, 4.0)))
    times = 'factor on it' if term.multiplies else 'factor'
    value = times if whole else of
    return Plot(
        f'{term.place} of {term.joint} ({value})',
        f'{argument.words} ({unit})' if unit else argument.words,
        tuple(curves),
        columns=columns,
    )


def _readable(unit: str, values: Array) -> tuple[str, float]:
    """A unit in which values (N,) can be read without a power of ten, and the factor to it."""
    _, unit, factor = in_degrees('_rad', unit)
    largest = factor * float(np.abs(values).max())
    if unit[:1] not in PREFIXED or largest >= LEAST_READABLE:
        return unit, factor
    prefix, more = ('m', 1e3) if largest >= 1e-3 * LEAST_READABLE else ('µ', 1e6)
    return prefix + unit, factor * more


MARKERS = {
    'nominal': 'M-4.5 0A4.5 4.5 0 1 0 4.5 0A4.5 4.5 0 1 0-4.5 0Z',
    'refitted': 'M-4-4H4V4H-4Z',
    'augmented': 'M0-6L6 0L0 6L-6 0Z',
}
"""Paths around the origin, px."""

LEAST = 0.1
"""What is less than this share of the noise is drawn here."""

WIDTH, LEFT, RIGHT, ROW, TOP = 1000.0, 200.0, 20.0, 32.0, 40.0


def ladder_figure(ladder: Ladder) -> str:
    """Draw rmse / noise of every signal for every model, on samples not used for fitting."""
    compared = list(ladder)
    signals = list(ladder[compared[0]])
    known = [max(fit.ratio, LEAST) for fits in ladder.values() for fit in fits.values()]
    low, high = math.log10(min(*known, 1.0) / 1.3), math.log10(max(*known, 1.0) * 1.3)
    bottom = TOP + ROW * len(signals)

    def across(ratio: float) -> float:
        share = (math.log10(max(ratio, LEAST)) - low) / (high - low)
        return LEFT + (WIDTH - LEFT - RIGHT) * share

    drawn = [_keys(compared)]
    for ratio in _ticks(10.0**low, 10.0**high):
        x = across(ratio)
        noise = ratio == 1.0
        line = 'stroke="var(--quiet)" stroke-dasharray="2 3"' if noise else 'stroke="var(--line)"'
        drawn.append(
            f'<path d="M{x:.1f} {TOP:g}V{bottom:g}" {line}/>'
            f'<text x="{x:.1f}" y="{bottom + 18:g}" text-anchor="middle">'
            f'{"noise" if noise else digits(ratio)}</text>'
        )
    for number, signal in enumerate(signals):
        middle = TOP + ROW * (number + 0.5)
        drawn.append(
            f'<text x="{LEFT - 14:g}" y="{middle + 5:g}" text-anchor="end" fill="var(--ink)">'
            f'{escape(plain(signal))}</text>'
        )
        for place, name in enumerate(compared):
            fit = ladder[name].get(signal)
            if fit is None:
                continue
            # Beside each other, so that none is hidden where two models are as good.
            y = middle + 0.17 * ROW * (place - 0.5 * (len(compared) - 1))
            text = f'{LABEL[name]}, {plain(signal)}: {digits(fit.ratio)} times the noise'
            drawn.append(_marker(name, across(fit.ratio), y, text))
    drawn.append(
        f'<text x="{WIDTH - RIGHT:g}" y="{bottom + 36:g}" text-anchor="end">'
        'rmse / noise on held-out samples</text>'
    )
    return (
        f'<svg viewBox="0 0 {WIDTH:g} {bottom + 44:g}" role="img" font-size="14" '
        f'fill="var(--quiet)" aria-label="The ladder of fits; its numbers are in the table">'
        f'{"".join(drawn)}</svg>'
    )


def _keys(compared: list[str]) -> str:
    """The legend, in one line above the rows."""
    drawn, x = [], LEFT
    for name in compared:
        drawn.append(
            f'{_marker(name, x + 6, 14, LABEL[name])}<text x="{x + 18:g}" y="19">'
            f'{escape(LABEL[name])}</text>'
        )
        x += 44.0 + 8.2 * len(LABEL[name])
    return ''.join(drawn)


def _marker(name: str, x: float, y: float, text: str) -> str:
    colour = f'var(--{COLOUR[name]})'
    return (
        f'<path d="{MARKERS[name]}" transform="translate({x:.1f} {y:.1f})" stroke="{colour}" '
        f'stroke-width="1.5" fill="{colour}">'
        f'<title>{escape(text)}</title></path>'
    )


def _ticks(low: float, high: float) -> list[float]:
    """One, two and five times the powers of ten in a range."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    ticks = [float(f'{k}e{power}') for power in powers for k in (1, 2, 5)]
    return [tick for tick in ticks if low <= tick <= high]
