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
    """Plot the latent term as estimated, and the formula found for it."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.2), layout='constrained')
        axis = figure.subplots()
        time, push, formula = thinned(term.time, term.push, term.formula_push)
        axis.plot(time, push, color=INK, lw=1.6, label='estimated without a formula')
        axis.plot(time, formula, color=RUNG_COLOUR['augmented'], lw=1.0, label='formula')
        axis.set_xlabel('time (s)')
        axis.set_ylabel(term.unit)
        axis.set_title(f'What acts on {term.joint} ({term.node}) and is in no simulation')
        axis.legend(loc='upper right', ncols=2, fontsize=8)
        return svg(figure)
