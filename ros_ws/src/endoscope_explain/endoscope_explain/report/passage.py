"""The signals in which the missing physics shows most, and when it shows."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from endoscope_core.physics.functions.places import Argument
from endoscope_core.physics.layout import OUT_JOINT, OUT_MOTOR_SPEED
from endoscope_core.physics.simulator import TICK
from endoscope_explain.case import Mismatch
from endoscope_explain.locate.excess import WINDOW_S
from endoscope_explain.observe.predicted_signals import RecordedView, SignalView
from endoscope_explain.recording import Array, Mask
from endoscope_explain.report.figures import TIME, look
from endoscope_pages import Curve, Plot, figure_html
from endoscope_pages.plots import COLUMNS

PASSAGE_S = 8.0
MOST_SIGNALS = 3
TITLES = {
    'bending': ', bending (deg)',
    'tension': ', tension (N)',
    'shaft_effort': ' (N m)',
    'shaft_position': ' (deg)',
}
"""Beside the name of a signal, by its quantity, in the order in which they are drawn."""
STATES = {
    ('w', 'rad/s'): ('speed of the motor', 'rad/s', OUT_MOTOR_SPEED, 1.0),
    ('v', 'm/s'): ('speed of the motor', 'rad/s', OUT_MOTOR_SPEED, 1.0),
    ('q', 'rad'): ('angle of the joint', 'deg', OUT_JOINT, math.degrees(1.0)),
}
"""Words, unit, column of the simulated outputs and factor, by an argument's symbol and unit."""


Drawn = list[tuple[str, Array, float]]
"""Curves by the name of a model, or of what was measured, with their widths."""


@dataclass(frozen=True)
class Axis:
    """What a signal is drawn against."""

    words: str
    unit: str
    time: Array  # (N,), s
    values: Array  # (N,), in that unit


def state_of(
    recorded: RecordedView, joint: str, command: tuple[Array, Array], argument: Argument | None
) -> Axis:
    """What the missing physics depends on, or the command (rad) if it is not the joint's."""
    shown = None if argument is None else STATES.get((argument.symbol, argument.unit))
    if shown is None:
        return Axis('command', 'deg', command[0], np.asarray(np.degrees(command[1]), np.float64))
    words, unit, column, factor = shown
    values = np.asarray(factor * recorded.outputs[joint][:, column], dtype=np.float64)
    time = recorded.begin + TICK * np.arange(len(values), dtype=np.float64)
    return Axis(words, unit, time, values)


def telling_signals(recorded: RecordedView, joint: str) -> tuple[SignalView, ...]:
    """Signals of a joint in which the best plant gains most on the described one."""
    views = recorded.of_joint(joint)
    plants = list(views[0].predicted)
    described, best = plants[0], plants[-1]
    if described == best:
        # There is nothing to gain: angle and tensions are shown.
        chosen = [v for v in views if v.quantity in ('bending', 'tension')]
    else:

        def gain(one: SignalView) -> float:
            return float(np.sum(one.residual(described) ** 2 - one.residual(best) ** 2))

        chosen = sorted(views, key=gain, reverse=True)[:MOST_SIGNALS]
    return tuple(sorted(chosen, key=lambda one: list(TITLES).index(one.quantity)))


def telling_passage(views: tuple[SignalView, ...]) -> tuple[float, float]:
    """Find begin and end, in s, of the passage in which the nominal prediction is furthest off."""
    first, last = float(views[0].time[0]), float(views[0].time[-1])
    if last - first <= PASSAGE_S:
        return first, last
    begins = np.arange(first, last - PASSAGE_S, 0.5)
    weight = np.zeros(len(begins))
    for one in views:
        misses = one.residual('nominal') ** 2
        cumulative = np.r_[0.0, np.cumsum(misses)]
        lower = np.searchsorted(one.time, begins)
        upper = np.searchsorted(one.time, begins + PASSAGE_S)
        found = cumulative[upper] - cumulative[lower]
        weight += found / max(float(found.max()), 1e-12)
    begin = float(begins[np.argmax(weight)])
    return begin, begin + PASSAGE_S


def passage_figure(views: tuple[SignalView, ...], over: Axis, passage: tuple[float, float]) -> str:
    """Plot signals, measured and predicted, by a state and in time, with each plant's misses."""
    loops, signals = [], []

    def plot(
        title: str, across: str, x: Array, drawn: Drawn, time: Array | None, **how: Any
    ) -> Plot:
        curves = (Curve(x=x, y=y, width=width, time=time, **look(name)) for name, y, width in drawn)
        return Plot(title, across, tuple(curves), loop=time is not None, **how)

    for one in views:
        inside = (one.time >= passage[0]) & (one.time <= passage[1])
        time = one.time[inside]
        state = np.interp(time, over.time, over.values)
        every = _curves(one, inside)
        missed = [(name, every[0][1] - values, width) for name, values, width in every[1:]]
        across, wide = f'{over.words} ({over.unit})', COLUMNS // len(views)
        loops.append(plot(_title(one), across, state, every, time, columns=wide, height=250))
        signals += [
            plot(_title(one), TIME, time, every, None, columns=7, height=130),
            plot('measured - predicted', TIME, time, missed, None, columns=5, height=130),
        ]
    return figure_html(loops + signals)


def _curves(one: SignalView, inside: Mask) -> Drawn:
    convert = np.degrees if one.unit == 'rad' else np.asarray
    curves = [('measured', convert(one.measured[inside]), 2.4)]
    curves += [(name, convert(values[inside]), 1.3) for name, values in one.predicted.items()]
    return curves


def _title(one: SignalView) -> str:
    return f'{one.signal.partition(":")[2]}{TITLES[one.quantity]}'


LEAST = 0.5
"""What is less than this share of the noise is drawn here."""


def timeline_figure(
    recorded: RecordedView, command: tuple[Array, Array], joint: str, places: Sequence[Mismatch]
) -> str:
    """Plot a joint's motion and, window by window, how far each prediction is off."""
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
