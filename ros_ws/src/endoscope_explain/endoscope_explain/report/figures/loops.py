"""Hysteresis loops and signals in the passage that tells most."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.pages.zoomable import COLUMNS, Curve, Plot, figure_html
from endoscope_explain.observe.predicted_signals import RecordedView, SignalView
from endoscope_explain.report.figures.style import TIME, look

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


def passage_figure(
    recorded: RecordedView, command: tuple[Array, Array], joint: str, passage: tuple[float, float]
) -> str:
    """Plot angle and tensions, measured and predicted: against the command, and over time.

    Beside them, what each plant misses. The command has stamps (N,) in s and angles (N,) in rad,
    joint-equivalent.
    """
    order = {'bending': 0, 'tension': 1}
    shown = [v for v in recorded.of_joint(joint) if v.quantity in order]
    views = sorted(shown, key=lambda v: order[v.quantity])
    loops, signals = [], []
    for one in views:
        inside = (one.time >= passage[0]) & (one.time <= passage[1])
        time = one.time[inside]
        angle = np.degrees(np.interp(time, *command))
        measured, *predicted = _curves(one, inside)
        loops.append(
            Plot(
                _title(one),
                'command (deg)',
                tuple(
                    Curve(x=angle, y=values, width=width, time=time, **look(name))
                    for name, values, width in (measured, *predicted)
                ),
                columns=COLUMNS // len(views),
                loop=True,
                height=250,
            )
        )
        signals += [
            Plot(
                _title(one),
                TIME,
                tuple(
                    Curve(x=time, y=values, width=width, **look(name))
                    for name, values, width in (measured, *predicted)
                ),
                columns=7,
                height=130,
            ),
            Plot(
                'measured - predicted',
                TIME,
                tuple(
                    Curve(x=time, y=measured[1] - values, width=width, **look(name))
                    for name, values, width in predicted
                ),
                columns=5,
                height=130,
            ),
        ]
    return figure_html(loops + signals)


def shown_plants(one: SignalView) -> tuple[str, ...]:
    """The described plant and the best one, once where they are the same."""
    return tuple(dict.fromkeys((next(iter(one.predicted)), list(one.predicted)[-1])))


def _curves(one: SignalView, inside: NDArray[np.bool_]) -> list[tuple[str, Array, float]]:
    convert = np.degrees if one.quantity == 'bending' else np.asarray
    curves = [('measured', convert(one.measured[inside]), 2.4)]
    curves += [(name, convert(one.predicted[name][inside]), 1.3) for name in shown_plants(one)]
    return curves


def _title(one: SignalView) -> str:
    name = one.signal.partition(':')[2]
    return f'{name}, bending (deg)' if one.quantity == 'bending' else f'{name}, tension (N)'
