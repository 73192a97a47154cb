"""The next experiment's motion, and what a missing function looks like."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.pages.zoomable import Curve, Plot, figure_html
from endoscope_explain.case import NextExperiment
from endoscope_explain.explanation import UnknownTerm
from endoscope_explain.fit.intervals import NINETY_PERCENT
from endoscope_explain.report.figures.style import COLOUR, TIME
from endoscope_explain.report.numbers import in_degrees
from endoscope_explain.report.sentences import LEAST_SHARE

Array = NDArray[np.float64]

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
        # A constant is the plant's numbers as well, and no recording says how much of it is where.
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
