"""The next experiment's motion, and what the latent term of unknown physics looks like."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from endoscope_explain.case import NextExperiment
from endoscope_explain.explanation import UnknownTerm
from endoscope_explain.report.figures.style import INK, RUNG_COLOUR, STYLE, svg, thinned


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


def unknown_figure(term: UnknownTerm) -> str:
    """Plot the missing function with its 90 % band, and the formula that comes nearest."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.6), layout='constrained')
        axis = figure.subplots()
        band = 1.645 * term.deviation
        axis.fill_between(
            term.nodes, term.values - band, term.values + band, color=INK, alpha=0.15, lw=0.0
        )
        axis.plot(term.nodes, term.values, color=INK, lw=1.6, label='function, with 90 % band')
        colour = RUNG_COLOUR['augmented']
        axis.plot(term.nodes, term.formula, color=colour, lw=1.0, label='formula')
        axis.set_xlabel(term.argument)
        axis.set_ylabel('logarithm of the factor' if term.unit == '-' else term.unit)
        axis.set_title(f'What is in no simulation of {term.joint}: {term.place}')
        axis.legend(loc='best', ncols=2, fontsize=8)
        return svg(figure)
