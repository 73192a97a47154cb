"""The next experiment's motion, and what a missing function looks like."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from endoscope_explain.case import NextExperiment
from endoscope_explain.explanation import UnknownTerm
from endoscope_explain.fit.intervals import NINETY_PERCENT
from endoscope_explain.report.figures.style import INK, RUNG_COLOUR, STYLE, svg, thinned
from endoscope_explain.report.numbers import in_degrees

Array = NDArray[np.float64]


def experiment_figure(experiment: NextExperiment) -> str:
    """Plot the proposed motion."""
    time = np.array(experiment.time)
    angle = np.degrees(np.array(experiment.command))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 1.9), layout='constrained')
        axis = figure.subplots()
        for column, joint in enumerate(experiment.joints):
            x, y = thinned(time, angle[:, column])
            axis.plot(
                x, y, lw=1.2, color=INK if joint == experiment.joint else '#9aa5b1', label=joint
            )
        axis.set_xlabel('time (s)')
        axis.set_ylabel('command (deg)')
        axis.legend(loc='upper right', ncols=2, fontsize=8)
        return svg(figure)


def unknown_figure(term: UnknownTerm, formula: bool) -> str:
    """Plot the missing function with its 90 % band.

    Parameters
    ----------
    term : UnknownTerm
    formula : bool
        Whether to draw the formula that comes nearest as well.

    Returns
    -------
    str
        SVG, angles in degrees; of a factor's logarithm the factor.
    """
    words, _, unit = term.argument.rpartition(', ')
    _, unit, across = in_degrees('_rad', unit)
    _, of, up = in_degrees('_rad', term.unit)
    factor = term.unit == '-'

    def drawn(values: Array) -> Array:
        return np.exp(values) if factor else up * values

    band = NINETY_PERCENT * term.deviation
    nodes = across * term.nodes
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.6), layout='constrained')
        axis = figure.subplots()
        low, high = drawn(term.values - band), drawn(term.values + band)
        axis.fill_between(nodes, low, high, color=INK, alpha=0.15, lw=0.0)
        axis.plot(nodes, drawn(term.values), color=INK, lw=1.6, label='function, with 90 % band')
        if formula:
            colour = RUNG_COLOUR['augmented']
            axis.plot(nodes, drawn(term.formula), '--', color=colour, lw=1.2, label='formula')
        axis.set_xlabel(f'{words} ({unit})' if unit else words)
        axis.set_ylabel('factor' if factor else of)
        axis.set_title(f'{term.place} of {term.joint}')
        axis.legend(loc='best', ncols=2, fontsize=8)
        return svg(figure)
