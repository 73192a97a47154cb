"""A library of terms, each the trace that one effect of the catalogue would leave."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from endoscope_core.plant.kernel import OUT_MOTOR, OUT_TENSION_A, OUT_TENSION_B
from endoscope_explain.observation import TICK
from endoscope_explain.predicted_signals import RecordedView, SignalView

Array = NDArray[np.float64]

SIGNALS = 3
"""Positive wire, negative wire, bending angle."""
PERIOD_S = 0.025


@dataclass(frozen=True)
class Term:
    """One column.

    Attributes
    ----------
    effect : str
        The effect that it stands for.
    signals : tuple of int
        Residuals in which it may show: 0, 1 the wires, 2 the bending angle.
    values : array (M,)
        Of unit spread.
    """

    effect: str
    signals: tuple[int, ...]
    values: Array


@dataclass(frozen=True)
class Problem:
    """A regression problem.

    Attributes
    ----------
    residuals : array (M, 3)
        Of wires and angle, in noise units.
    terms : tuple of Term
    states : dict of str to array (M,)
        Of unit spread, for symbolic regression.
    """

    residuals: Array
    terms: tuple[Term, ...]
    states: dict[str, Array]


def problem_of(recorded: RecordedView, joint: str, fit: str) -> Problem:
    """Pose the regression problem of one joint.

    Parameters
    ----------
    recorded : RecordedView
        With the prediction `fit`.
    joint : str
    fit : str
        Whose residual is to be explained.

    Returns
    -------
    Problem
        On a grid of `PERIOD_S`.
    """
    views = [v for v in recorded.of_joint(joint) if v.quantity in ('tension', 'bending')]
    end = min(float(v.time[-1]) for v in views)
    grid = np.arange(2.0 * PERIOD_S, end - PERIOD_S, PERIOD_S)
    residuals = np.stack([_on_grid(v, v.residual(fit), grid) for v in views], axis=1)
    states = _states(recorded, joint, grid)
    terms = tuple(_terms(states, grid))
    scaled = {k: v for k, value in states.items() if (v := _scaled(value)) is not None}
    return Problem(residuals, terms, scaled)


def _on_grid(view: SignalView, values: Array, grid: Array) -> Array:
    index = np.round((view.time - grid[0]) / PERIOD_S).astype(int)
    inside = (index >= 0) & (index < len(grid))
    total = np.bincount(index[inside], values[inside], len(grid))
    number = np.bincount(index[inside], minlength=len(grid))
    known = number > 0
    mean = total[known] / number[known]
    return np.interp(grid, grid[known], mean)


def _states(recorded: RecordedView, joint: str, grid: Array) -> dict[str, Array]:
    out = recorded.outputs[joint]
    time = recorded.begin + TICK * np.arange(len(out))

    def at(values: Array) -> Array:
        return np.interp(grid, time, values)

    others = [o for name, o in recorded.outputs.items() if name != joint]
    bending, motor = out[:, -1], out[:, OUT_MOTOR]
    q, m = at(bending), at(motor)
    states = {
        't': grid,
        'm': m,
        'dm': np.gradient(m, PERIOD_S),
        'q': q,
        'dq': np.gradient(q, PERIOD_S),
        'ta': at(out[:, OUT_TENSION_A]),
        'tb': at(out[:, OUT_TENSION_B]),
        'other': at(others[0][:, -1]) if others else 0.0 * grid,
    }
    states['ddm'] = np.gradient(states['dm'], PERIOD_S)
    states['ddq'] = np.gradient(states['dq'], PERIOD_S)
    states['v'] = 0.5 * (states['dm'] + states['dq'])
    difference = states['ta'] - states['tb']
    share = PERIOD_S / 2.0
    states['lagging'] = lfilter([share], [1.0, share - 1.0], difference)
    states['slid'] = np.cumsum(np.abs(states['v'])) * PERIOD_S
    states['play'] = _play(m, 0.3)
    return states


def _terms(s: dict[str, Array], t: Array) -> list[Term]:
    every, angle = (0, 1, 2), (2,)
    way, high = np.tanh(s['v'] / 0.05), np.quantile(np.abs(s['q']), 0.7)
    fast = np.quantile(np.abs(s['dm']), 0.9)
    strong = np.quantile(np.abs(s['ta'] - s['tb']), 0.9)
    low = np.quantile(np.minimum(s['ta'], s['tb']), 0.2)
    listed: list[tuple[str, tuple[int, ...], Array]] = [
        ('transport_delay', every, s['dm']),
        ('actuator_lag', every, s['ddm']),
        ('rate_limit', every, _beyond(s['dm'], fast)),
        ('torque_limit', every, _beyond(s['ta'] - s['tb'], strong)),
        ('gear_backlash', every, np.tanh(s['dm'] / 0.05)),
        ('wire_slack', every, np.maximum(low - s['ta'], 0) - np.maximum(low - s['tb'], 0)),
        ('pretension_loss', every, t),
        ('stribeck_friction', every, np.exp(-np.abs(s['v']) / 0.2) * way),
        ('viscous_friction', every, s['v']),
        ('wire_stiffening', every, (s['m'] - s['q']) ** 3),
        ('wire_creep', every, s['lagging']),
        ('friction_asymmetry', every, np.abs(way)),
        ('friction_run_in', every, np.exp(-s['slid'] / 3.0) * way),
        ('distributed_friction', every, s['m'] - s['play']),
        ('presliding_shape', every, (s['m'] - s['play']) * np.abs(s['m'] - s['play'])),
        ('joint_backlash', every, np.tanh((s['ta'] - s['tb']) / 0.5)),
        ('joint_stop', every, _beyond(s['q'], high)),
        ('contact', every, np.maximum(s['q'] - high, 0.0)),
        ('contact', every, np.maximum(-s['q'] - high, 0.0)),
        ('gravity', every, np.sin(s['q'])),
        ('joint_inertia', every, s['ddq']),
        ('cross_coupling', every, s['other']),
        ('tracker_bias', angle, np.ones_like(t) + 1e-3 * np.sin(t)),
        ('tracker_distortion', angle, s['q'] ** 2),
        ('tracker_distortion', angle, s['q'] ** 3),
        ('tracker_delay', angle, s['dq']),
        ('tracker_drift', angle, t),
        ('clock_skew', angle, t * s['dq']),
    ]
    for wire, (own, other) in enumerate((('ta', 'tb'), ('tb', 'ta'))):
        listed += [
            ('load_cell_gain', (wire,), s[own]),
            ('load_cell_crosstalk', (wire,), s[other]),
            ('load_cell_drift', (wire,), t),
            ('load_cell_saturation', (wire,), np.maximum(s[own] - np.quantile(s[own], 0.8), 0.0)),
        ]
    for teeth in (6.0, 12.0, 24.0):
        listed += [('cogging', every, f(0.5 * teeth * s['m'])) for f in (np.sin, np.cos)]
    for onset in np.linspace(0.2, 0.8, 7) * t[-1]:
        after = (t > onset).astype(float)
        listed += [('configuration_change', every, after * way), ('external_load', every, after)]
    for frequency in np.arange(0.15, 0.65, 0.05):
        listed += [('breathing', every, f(2.0 * np.pi * frequency * t)) for f in (np.sin, np.cos)]
    return [
        Term(effect, signals, v)
        for effect, signals, values in listed
        if (v := _scaled(values)) is not None
    ]


def _scaled(values: Array) -> Array | None:
    spread = float(np.sqrt(np.mean(values**2)))
    return None if spread < 1e-12 else values / spread


def _beyond(values: Array, limit: float) -> Array:
    return np.asarray(np.sign(values) * np.maximum(np.abs(values) - limit, 0.0))


def _play(values: Array, width: float) -> Array:
    out = np.empty_like(values)
    here = values[0]
    for i, value in enumerate(values):
        here = min(max(here, value - 0.5 * width), value + 0.5 * width)
        out[i] = here
    return out
