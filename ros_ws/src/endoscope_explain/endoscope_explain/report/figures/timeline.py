"""When a mismatch shows: motion above, misfit in units of the noise below."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from endoscope_core.pages.zoomable import Curve, Plot, figure_html
from endoscope_explain.case import Place
from endoscope_explain.locate.time_windows import WINDOW_S
from endoscope_explain.observe.predicted_signals import RecordedView, SignalView
from endoscope_explain.report.figures.style import TIME, look

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
    edges, levels = _misfit(views)
    pointing = partial(
        Plot,
        x_label=TIME,
        range_x=(0.0, float(bending.time[-1])),
        shaded=tuple(
            (begin, max(end, begin + 0.05)) for p in places[:2] for begin, end in p.intervals
        ),
        marks=tuple(p.onset_s for p in places[:2] if p.onset_s is not None),
    )
    motion = pointing(
        f'Motion of {joint} (deg)',
        curves=(
            Curve('command', command[0], np.degrees(command[1]), 'wanted', dash=(6.0, 4.0)),
            Curve('bending, measured', bending.time, np.degrees(bending.measured)),
        ),
        height=130,
    )
    marked = '; shaded: where it shows' if any(place.intervals for place in places) else ''
    highest = max(10.0, 2.0 * float(np.nanmax(levels['nominal'])))
    misfit = pointing(
        f'Misfit of its signals / noise{marked}',
        curves=tuple(
            Curve(x=edges, y=np.maximum(level, LEAST), **look(name))
            for name, level in levels.items()
        ),
        height=160,
        log=True,
        range_y=(0.9 * LEAST, highest),
        level=(1.0, 'noise'),
    )
    return figure_html([motion, misfit])


def _misfit(views: Sequence[SignalView]) -> tuple[Array, dict[str, Array]]:
    """Edges of the windows, and the rms over the signals of each window's mean squared residual."""
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
    return np.arange(count + 1, dtype=np.float64) * WINDOW_S, levels
