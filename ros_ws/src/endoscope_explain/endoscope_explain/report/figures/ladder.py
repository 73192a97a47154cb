"""The ladder of fits."""

import numpy as np

from endoscope_explain.case import Ladder
from endoscope_explain.report.figures.style import (
    INK,
    RUNG_COLOUR,
    RUNG_TITLE,
    page_figure,
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
    """Plot rmse / noise of every signal for every model, on samples not used for fitting."""
    rungs = list(ladder)
    signals = list(ladder[rungs[0]])
    with page_figure(0.30 * len(signals) + 1.1) as figure:
        axis = figure.subplots()
        rows = np.arange(len(signals))[::-1]
        for number, name in enumerate(rungs):
            # Beside each other, so that none is hidden where two models are as good.
            beside = rows + 0.17 * (0.5 * (len(rungs) - 1) - number)
            known = [(r, s) for r, s in zip(beside, signals, strict=True) if s in ladder[name]]
            axis.plot(
                [max(ladder[name][s].ratio, LEAST) for _, s in known],
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
        axis.set_yticks(rows, [plain(s) for s in signals])
        axis.set_ylim(-0.6, len(signals) - 0.2)
        axis.set_xlabel('rmse / noise on held-out samples')
        figure.legend(loc='outside upper left', ncols=3)
        return svg(figure)
