"""A library of terms: what a function at each place, or an effect, would leave in a residual.

The terms are algebraic in the states of the simulation, as for every regression on a library; what
the chain does to them on their way to the sensors is not in them.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from endoscope_benchmarks.peers.problem import PERIOD_S, SIGNALS, Problem
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import Place, Shape

Array = NDArray[np.float64]

EVERY = tuple(range(len(SIGNALS)))
_, EFFORT, POSITIVE, NEGATIVE, BENDING = EVERY
SAME = 0.98
"""Correlation from which two terms are one: the place that is of some effect's family stays."""
STATE_OF_ARGUMENT = {
    ('t', 's'): 't', ('v', 'm/s'): 'v', ('d', 'm'): 'd', ('T', 'N'): 'T', ('D', 'N'): 'D',
    ('q', 'rad'): 'q', ('q_other', 'rad'): 'other', ('w', 'rad/s'): 'dq', ('m', 'rad'): 'm',
    ('u', 'rad'): 'u', ('e', 'rad'): 'e', ('s', 'm'): 'm', ('F', 'N'): 'D', ('y', 'm/s'): 'v',
    ('z', 'rad'): 'q',
}  # fmt: skip
"""State that a place's function depends on, or follows, by symbol and unit."""
LAG_SHARE = 0.5 * PERIOD_S
"""Share of the way that what lags by 2 s goes from sample to sample."""


class Term(NamedTuple):
    """The place or effect it stands for, the columns of residuals that show it, values (M,)."""

    name: str
    signals: tuple[int, ...]
    values: Array


def terms_of(problem: Problem) -> tuple[Term, ...]:
    """The library, each column once."""
    families = {place for effect in CATALOGUE.values() for place in effect.traits.families}
    places = sorted(FUNCTIONS.values(), key=lambda place: place.id not in families)
    kept: list[Term] = []
    for term in [*(t for p in places for t in _of_place(p, problem.states)), *_of_effects(problem)]:
        size = float(np.sqrt(np.mean(term.values**2)))
        if size < 1e-12:
            continue
        values = term.values / size
        known = [k.values for k in kept if k.signals == term.signals]
        if all(abs(float(np.mean(values * other))) < SAME for other in known):
            kept.append(Term(term.name, term.signals, values))
    return tuple(kept)


def _of_place(place: Place, states: Mapping[str, Array]) -> Iterator[Term]:
    argument = states[STATE_OF_ARGUMENT[place.argument.symbol, place.argument.unit]]
    signals = {'effort': (EFFORT,), 'tracker': (BENDING,)}.get(place.hook.name, EVERY)
    if place.hook.name == 'effort':
        argument = states['dm']
    if place.hook.name == 'load_cell':
        own, other = ('ta', 'tb') if 'pos' in place.id else ('tb', 'ta')
        signals = (POSITIVE if own == 'ta' else NEGATIVE,)
        if place.argument.unit == 'N':
            argument = states[other if 'other' in place.id else own]
    way = np.tanh(states['v'] / (0.1 * np.std(states['v']) + 1e-12))
    factors = {
        'exponent': way * states['T'],
        'film_drag': way,
        'stiffness': states['D'],
        'joint_friction': np.sign(states['dq']),
    }
    factor = factors.get(place.hook.name, np.ones_like(argument))
    if place.argument.symbol == 'v':
        argument = np.abs(argument)
    if place.argument.lags:
        argument = np.abs(argument) if place.argument.symbol == 'y' else argument
        late = lfilter([LAG_SHARE], [1.0, LAG_SHARE - 1.0], argument)
        argument = argument - late if place.argument.symbol == 'z' else late
    for values in _functions(argument, place):
        yield Term(place.id, signals, factor * values)


def _functions(argument: Array, place: Place) -> Iterator[Array]:
    x = argument / (float(np.max(np.abs(argument))) + 1e-12)
    if place.shape is Shape.ODD:
        yield from (x, x**3, np.tanh(5.0 * x))
    elif place.shape is Shape.EVEN:
        yield from (x**2, np.abs(x))
    elif place.shape is Shape.PERIODIC:
        rates = (0.15, 0.25, 0.35, 0.45) if place.argument.unit == 's' else (2.0, 4.0, 6.0, 12.0)
        cycle = 2.0 * np.pi if place.argument.unit == 's' else 1.0
        for rate in rates:
            yield from (np.sin(cycle * rate * argument), np.cos(cycle * rate * argument))
    else:
        yield from (x, x**2, x**3, np.exp(-5.0 * np.abs(x)))


def _of_effects(problem: Problem) -> Iterator[Term]:
    """Of those effects that are no function of one state."""
    s, tanh = problem.states, np.tanh
    tight = np.quantile(np.minimum(s['ta'], s['tb']), 0.2)
    beyond = np.maximum(np.abs(s['D']) - np.quantile(np.abs(s['D']), 0.9), 0.0)
    way = tanh(s['v'] / (0.1 * np.std(s['v']) + 1e-12))
    everywhere = {
        'transport_delay': s['dm'],
        'actuator_lag': s['ddm'],
        'torque_limit': np.sign(s['D']) * beyond,
        'gear_backlash': tanh(s['dm'] / 0.05),
        'wire_slack': np.maximum(tight - s['ta'], 0.0) - np.maximum(tight - s['tb'], 0.0),
        'wire_creep': lfilter([LAG_SHARE], [1.0, LAG_SHARE - 1.0], s['D']),
        'friction_asymmetry': np.abs(way) * s['T'],
        'joint_backlash': tanh(s['D'] / 0.5),
        'joint_inertia': s['ddq'],
    }
    at_the_tip = {
        'tracker_bias': np.ones_like(s['t']),
        'tracker_delay': s['dq'],
        'clock_skew': s['t'] * s['dq'],
    }
    yield from (Term(name, EVERY, values) for name, values in everywhere.items())
    yield from (Term(name, (BENDING,), values) for name, values in at_the_tip.items())
    for signal, own in ((POSITIVE, s['ta']), (NEGATIVE, s['tb'])):
        high = np.maximum(own - np.quantile(own, 0.8), 0.0)
        yield Term('load_cell_saturation', (signal,), high)
