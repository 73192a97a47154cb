"""The ladder of fits."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from endoscope_explain.case import Ladder
from endoscope_explain.report.figures.style import (
    INK,
    RUNG_COLOUR,
    RUNG_TITLE,
    STYLE,
    svg,
)
from endoscope_explain.report.sentences import plain

MARKERS = {
    'nominal': 'o',
    'refitted': 's',
    'augmented': 'D',
    'gaussian_process': '^',
    'neural_network': 'v',
}

LEAST = 0.1
"""What is less than this share of the noise is drawn here."""


def ladder_figure(ladder: Ladder) -> str:
    """Plot rmse / noise of every signal for every model, on samples not used for fitting.

    Parameters
    ----------
    ladder : Ladder
        Of what is shown.

    Returns
    -------
    str
        SVG.
    """
    rungs = list(ladder)
    signals = list(ladder[rungs[0]])
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 0.30 * len(signals) + 1.1), layout='constrained')
        axis = figure.subplots()
        rows = np.arange(len(signals))[::-1]
        for number, name in enumerate(rungs):
            fits = [ladder[name].get(signal) for signal in signals]
            known = [
                (r, max(f.ratio, LEAST)) for r, f in zip(rows, fits, strict=True) if f is not None
            ]
            axis.plot(
                [v for _, v in known],
                # Beside each other, so that none is hidden where two models are as good.
                [r + 0.17 * (0.5 * (len(rungs) - 1) - number) for r, _ in known],
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
        axis.set_yticks(rows, [plain(s) for s in signals])
        axis.set_ylim(-0.6, len(signals) - 0.2)
        axis.set_xlabel('rmse / noise on held-out samples')
        figure.legend(loc='outside upper left', ncols=3, fontsize=8)
        return svg(figure)
