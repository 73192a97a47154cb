"""The ladder of fits, and what the parameters are."""

from collections.abc import Mapping

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from endoscope_explain.case import Ladder
from endoscope_explain.explanation import NominalEstimate
from endoscope_explain.report.figures.style import (
    GUILTY,
    INK,
    RUNG_COLOUR,
    RUNG_TITLE,
    STYLE,
    svg,
)

RUNGS = ('nominal', 'refitted', 'augmented', 'gaussian_process', 'neural_network')
MARKERS = {
    'nominal': 'o',
    'refitted': 's',
    'augmented': 'D',
    'gaussian_process': '^',
    'neural_network': 'v',
}


def ladder_figure(ladder: Ladder) -> str:
    """Plot rmse / noise of every signal for every rung, on samples not used for fitting.

    Parameters
    ----------
    ladder : Ladder

    Returns
    -------
    str
        SVG.
    """
    rungs = [name for name in RUNGS if name in ladder]
    signals = list(ladder[rungs[0]])
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 0.30 * len(signals) + 1.1), layout='constrained')
        axis = figure.subplots()
        rows = np.arange(len(signals))[::-1]
        for name in rungs:
            fits = [ladder[name].get(signal) for signal in signals]
            known = [(r, f.ratio) for r, f in zip(rows, fits, strict=True) if f is not None]
            axis.plot(
                [v for _, v in known],
                [r for r, _ in known],
                MARKERS[name],
                color=RUNG_COLOUR[name],
                ms=6.5,
                label=RUNG_TITLE[name],
                mfc='none' if name in ('gaussian_process', 'neural_network') else None,
            )
        axis.axvline(1.0, color=INK, lw=0.8, ls=':')
        axis.annotate(
            'noise',
            (1.0, 1.0),
            xycoords=('data', 'axes fraction'),
            fontsize=8,
            xytext=(3, -2),
            textcoords='offset points',
            va='top',
        )
        axis.set_xscale('log')
        axis.set_yticks(rows, [s.replace('/measured_js', '') for s in signals])
        axis.set_ylim(-0.6, len(signals) - 0.2)
        axis.set_xlabel('rmse / noise on held-out samples')
        figure.legend(loc='outside upper left', ncols=3, fontsize=8)
        return svg(figure)


def parameters_figure(parameters: Mapping[str, Mapping[str, NominalEstimate]]) -> str:
    """Plot each fitted nominal parameter as a multiple of its described value, with intervals.

    Parameters
    ----------
    parameters : mapping of joint to mapping of name to NominalEstimate

    Returns
    -------
    str
        SVG.
    """
    joints = list(parameters)
    names = list(dict.fromkeys(n for one in parameters.values() for n in one))
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 0.26 * len(names) + 0.9), layout='constrained')
        axes = np.atleast_1d(figure.subplots(1, len(joints), sharey=True, sharex=True))
        for axis, joint in zip(axes, joints, strict=True):
            for row, name in enumerate(reversed(names)):
                estimate = parameters[joint].get(name)
                if estimate is None or estimate.nominal == 0.0:
                    continue
                value, low, high = (
                    v / estimate.nominal for v in (estimate.value, estimate.low, estimate.high)
                )
                colour = INK if estimate.in_band else GUILTY
                axis.plot([low, high], [row, row], color=colour, lw=2.0, solid_capstyle='round')
                axis.plot([value], [row], 'o', color=colour, ms=4.5)
            axis.axvline(1.0, color='#9aa5b1', lw=1.0)
            axis.set_yticks(range(len(names)), list(reversed(names)))
            axis.set_title(joint)
            axis.set_xlabel('fitted / described')
        low, high = axes[0].get_xlim()
        axes[0].set_xlim(min(low, 0.8), max(high, 1.2))
        return svg(figure)
