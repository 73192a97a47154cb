"""The next experiment's motion, and what a missing function looks like."""

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from endoscope_explain.case import NextExperiment
from endoscope_explain.explanation import UnknownTerm
from endoscope_explain.fit.intervals import NINETY_PERCENT
from endoscope_explain.report.figures.style import INK, RUNG_COLOUR, page_figure, svg, thinned
from endoscope_explain.report.numbers import in_degrees
from endoscope_explain.report.sentences import LEAST_SHARE

Array = NDArray[np.float64]


def experiment_figure(experiment: NextExperiment) -> str:
    """Plot the proposed motion."""
    time = np.array(experiment.time)
    angle = np.degrees(np.array(experiment.command))
    with page_figure(1.9) as figure:
        axis = figure.subplots()
        for column, joint in enumerate(experiment.joints):
            x, y = thinned(time, angle[:, column])
            axis.plot(
                x, y, lw=1.2, color=INK if joint == experiment.joint else '#9aa5b1', label=joint
            )
        axis.set_xlabel('time (s)')
        axis.set_ylabel('command (deg)')
        axis.legend(loc='upper right', ncols=2)
        return svg(figure)


def unknown_figure(term: UnknownTerm) -> str:
    """Plot the missing function, and those that multiply it, each with its 90 % band.

    The formula that comes near is drawn, too, if there is one.
    """
    every = (term, *term.factors)
    with page_figure(2.6) as figure:
        for axis, one in zip(figure.subplots(1, len(every), squeeze=False)[0], every, strict=True):
            _draw_function(axis, one)
        return svg(figure)


def _draw_function(axis: Axes, term: UnknownTerm) -> None:
    argument = term.there.argument
    _, unit, across = in_degrees('_rad', argument.unit)
    _, of, up = in_degrees('_rad', term.there.unit)

    def drawn(values: Array) -> Array:
        if term.multiplies:
            return 1.0 + values
        return np.exp(values) if term.there.is_factor else up * values

    band = NINETY_PERCENT * term.deviation
    nodes = across * term.nodes
    low, high = drawn(term.values - band), drawn(term.values + band)
    axis.fill_between(nodes, low, high, color=INK, alpha=0.15, lw=0.0)
    axis.plot(nodes, drawn(term.values), color=INK, lw=1.6, label='function, with 90 % band')
    if term.formula_share >= LEAST_SHARE:
        colour = RUNG_COLOUR['augmented']
        axis.plot(nodes, drawn(term.formula), '--', color=colour, lw=1.2, label='formula')
    axis.set_xlabel(f'{argument.words} ({unit})' if unit else argument.words)
    times = 'factor on it' if term.multiplies else 'factor'
    axis.set_ylabel(times if term.multiplies or term.there.is_factor else of)
    axis.set_title(f'{term.place} of {term.joint}')
    axis.legend(loc='best', ncols=2)
