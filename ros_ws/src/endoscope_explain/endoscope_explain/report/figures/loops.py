"""Hysteresis loops and signals in the passage that tells most."""

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from endoscope_explain.observe.predicted_signals import RecordedView, SignalView
from endoscope_explain.report.figures.style import ABOVE, look, page_figure, svg, thinned

Array = NDArray[np.float64]

PASSAGE_S = 8.0


def telling_passage(recorded: RecordedView, joint: str) -> tuple[float, float]:
    """Find begin and end, in s, of the passage in which the nominal prediction is furthest off."""
    views = recorded.of_joint(joint)
    first, last = float(views[0].time[0]), float(views[0].time[-1])
    if last - first <= PASSAGE_S:
        return first, last
    begins = np.arange(first, last - PASSAGE_S, 0.5)
    weight = np.zeros(len(begins))
    for one in views:
        if one.quantity not in ('tension', 'bending'):
            continue
        misses = one.residual('nominal') ** 2
        cumulative = np.r_[0.0, np.cumsum(misses)]
        lower = np.searchsorted(one.time, begins)
        upper = np.searchsorted(one.time, begins + PASSAGE_S)
        found = cumulative[upper] - cumulative[lower]
        weight += found / max(float(found.max()), 1e-12)
    begin = float(begins[np.argmax(weight)])
    return begin, begin + PASSAGE_S


def loops_figure(
    recorded: RecordedView, command: tuple[Array, Array], joint: str, passage: tuple[float, float]
) -> str:
    """Plot angle and tensions against the command, measured and predicted.

    The command has stamps (N,) in s and angles (N,) in rad, joint-equivalent.
    """
    views = _shown(recorded, joint)
    with page_figure(3.5) as figure:
        for axis, one in zip(figure.subplots(1, len(views), squeeze=False)[0], views, strict=True):
            inside = (one.time >= passage[0]) & (one.time <= passage[1])
            time = one.time[inside]
            angle = np.degrees(np.interp(time, *command))
            for name, values, width in _curves(one, inside):
                _draw(axis, angle, name, values, width)
            axis.set_title(_title(one))
            axis.set_xlabel('command (deg)')
        figure.legend(
            *axis.get_legend_handles_labels(), loc='outside upper right', ncols=3, fontsize=8
        )
        return svg(figure)


def signals_figure(recorded: RecordedView, joint: str, passage: tuple[float, float]) -> str:
    """Plot angle and tensions over time, measured and predicted, and what each plant misses."""
    views = _shown(recorded, joint)
    with page_figure(1.5 * len(views) + 0.4) as figure:
        axes = figure.subplots(len(views), 2, sharex=True, squeeze=False, width_ratios=(1.6, 1.0))
        for (axis, missed), one in zip(axes, views, strict=True):
            inside = (one.time >= passage[0]) & (one.time <= passage[1])
            curves = _curves(one, inside)
            for name, values, width in curves:
                _draw(axis, one.time[inside], name, values, width)
                if name != 'measured':
                    _draw(missed, one.time[inside], name, curves[0][1] - values, width)
            axis.set_title(_title(one))
            missed.set_title('measured - predicted')
        axes[0, 0].legend(**ABOVE, ncols=3)
        for axis in axes[-1]:
            axis.set_xlabel('time (s)')
            axis.set_xlim(passage)
        return svg(figure)


def _draw(axis: Axes, across: Array, name: str, values: Array, width: float) -> None:
    behind = 1 if name == 'measured' else 2
    axis.plot(*thinned(across, values), **look(name), lw=width, zorder=behind)


def shown_plants(one: SignalView) -> tuple[str, ...]:
    """The described plant and the best one, once where they are the same."""
    return tuple(dict.fromkeys((next(iter(one.predicted)), list(one.predicted)[-1])))


def _shown(recorded: RecordedView, joint: str) -> list[SignalView]:
    order = {'bending': 0, 'tension': 1}
    views = [v for v in recorded.of_joint(joint) if v.quantity in order]
    return sorted(views, key=lambda v: order[v.quantity])


def _curves(one: SignalView, inside: NDArray[np.bool_]) -> list[tuple[str, Array, float]]:
    convert = np.degrees if one.quantity == 'bending' else np.asarray
    curves = [('measured', convert(one.measured[inside]), 2.2)]
    curves += [(name, convert(one.predicted[name][inside]), 1.0) for name in shown_plants(one)]
    return curves


def _title(one: SignalView) -> str:
    name = one.signal.partition(':')[2]
    return f'{name}, bending (deg)' if one.quantity == 'bending' else f'{name}, tension (N)'
