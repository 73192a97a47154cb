"""When a mismatch shows: motion above, misfit in units of the noise below."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from endoscope_explain.case import Place
from endoscope_explain.locate.time_windows import WINDOW_S
from endoscope_explain.observe.predicted_signals import RecordedView, SignalView
from endoscope_explain.report.figures.style import (
    ABOVE,
    GUILTY,
    INK,
    SHADE,
    look,
    page_figure,
    svg,
    thinned,
)

Array = NDArray[np.float64]

LEAST = 0.5
"""What is less than this share of the noise is drawn here."""


def timeline_figure(
    recorded: RecordedView, command: tuple[Array, Array], joint: str, places: Sequence[Place]
) -> str:
    """Plot a joint's motion and, window by window, how far each prediction is off.

    The command has stamps (N,) in s and angles (N,) in rad, joint-equivalent; the intervals of the
    places are shaded.
    """
    views = recorded.of_joint(joint)
    bending = next(v for v in views if v.quantity == 'bending')
    with page_figure(3.9) as figure:
        motion, misfit = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.25))
        for axis in (motion, misfit):
            _shade(axis, places)
        time, angle = thinned(*command)
        motion.plot(time, np.degrees(angle), color='#9aa5b1', lw=1.0, label='command')
        motion.plot(
            bending.time, np.degrees(bending.measured), color=INK, lw=0.9, label='bending, measured'
        )
        motion.set_ylabel('deg')
        motion.legend(**ABOVE, ncols=2)
        motion.set_title(f'Motion of {joint}')
        centres, levels = _misfit(views)
        for name, level in levels.items():
            misfit.step(centres, np.maximum(level, LEAST), where='mid', lw=1.1, **look(name))
        misfit.axhline(1.0, color=INK, lw=0.8, ls=':')
        misfit.annotate(
            'noise',
            (1.0, 1.0),
            xycoords=('axes fraction', 'data'),
            fontsize=8,
            xytext=(-2, 3),
            textcoords='offset points',
            ha='right',
        )
        misfit.set_yscale('log')
        misfit.set_ylim(0.9 * LEAST, max(10.0, 2.0 * float(np.nanmax(levels['nominal']))))
        misfit.set_ylabel('misfit / noise')
        misfit.set_xlabel('time (s)')
        marked = '; shaded: where it shows' if any(place.intervals for place in places) else ''
        misfit.set_title(f'Misfit of its signals{marked}')
        misfit.legend(**ABOVE, ncols=3)
        misfit.set_xlim(0.0, float(bending.time[-1]))
        return svg(figure)


def _shade(axis: Axes, places: Sequence[Place]) -> None:
    for number, place in enumerate(places[:2]):
        for begin, end in place.intervals:
            axis.axvspan(
                begin,
                max(end, begin + 0.05),
                color=SHADE,
                lw=0,
                zorder=0,
                alpha=1.0 if number == 0 else 0.6,
            )
        if place.onset_s is not None:
            axis.axvline(place.onset_s, color=GUILTY, lw=1.2)


def _misfit(views: Sequence[SignalView]) -> tuple[Array, dict[str, Array]]:
    """Root mean square over the signals of each window's mean squared residual."""
    end = max(float(v.time[-1]) for v in views)
    count = int(np.ceil(end / WINDOW_S)) + 1
    levels = {}
    for name in views[0].predicted:
        total, number = np.zeros(count), np.zeros(count)
        for one in views:
            index = (one.time / WINDOW_S).astype(int)
            total += np.bincount(index, one.residual(name) ** 2, count)
            number += np.bincount(index, None, count)
        levels[name] = np.sqrt(total / np.where(number > 0, number, np.nan))
    return (np.arange(count, dtype=np.float64) + 0.5) * WINDOW_S, levels
