"""A library of terms: what a function at each place, or an effect, would leave in a residual.

The terms are algebraic in the states of the simulation, as for every regression on a library; what
the chain does to them on their way to the sensors is not in them.
"""

import warnings
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import Place, Shape
from endoscope_lab.concealed.judge import Statement
from endoscope_lab.peers.problem import PERIOD_S, SIGNALS, OwnExample, Problem, predicts

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


STEPS = 3
THRESHOLDS = (0.05, 0.1, 0.2, 0.4)
"""Shares of the residual's spread; the one that predicts held-out blocks best is kept."""
MODELS = 20
RIDGE = 0.05
"""Share of the samples: columns of a library of physics are nearly collinear."""


def by_forward_selection(problem: Problem) -> Statement | None:
    """The name whose terms explain most after a few steps of matching pursuit."""
    # Pati, Rezaiifar, Krishnaprasad, Asilomar 1993, with a price for each coefficient (Schwarz,
    # Ann. Stat. 6, 1978).
    terms = terms_of(problem)
    design = np.stack([term.values for term in terms], axis=1)
    seen, left = design[~problem.held_out], problem.residuals[~problem.held_out]
    chosen = _pursuit(seen, left, terms)
    weights = np.zeros((len(SIGNALS), len(terms)))
    for signal in range(len(SIGNALS)):
        shown = [k for k in chosen if signal in terms[k].signals]
        weights[signal, shown] = np.linalg.lstsq(seen[:, shown], left[:, signal], rcond=None)[0]
    return _strongest(problem, terms, design, weights)


def by_sindy(problem: Problem) -> Statement | None:
    """The name whose terms carry most of an ensemble of sparse models."""
    # Fasel, Kutz, Brunton, Brunton, Proc. R. Soc. A 478, 2022.
    terms = terms_of(problem)
    design = np.stack([term.values for term in terms], axis=1)
    spread = problem.residuals.std(axis=0) + 1e-9
    scaled = problem.residuals / spread
    held = problem.held_out
    fits = []
    for threshold in THRESHOLDS:
        weights = _ensemble(design[~held], scaled[~held], threshold)
        for k, term in enumerate(terms):
            weights[[s for s in range(len(SIGNALS)) if s not in term.signals], k] = 0.0
        left = scaled[held] - design[held] @ weights.T
        fits.append((float(np.mean(left**2)), threshold, weights))
    _, _, weights = min(fits, key=lambda each: each[:2])
    return _strongest(problem, terms, design, spread[:, None] * weights)


def forward_selection_example() -> OwnExample:
    """Tropp, Gilbert, IEEE Trans. Inf. Theory 53, 2007: a sparse signal from few random sums."""
    draw = np.random.default_rng(1)
    design = draw.standard_normal((120, 256))
    true = draw.choice(256, STEPS, replace=False)
    target = design[:, true].sum(axis=1)
    terms = [Term(str(k), (0,), design[:, k]) for k in range(256)]
    found = len(set(_pursuit(design, target[:, None], tuple(terms))) & set(true))
    return OwnExample('3 of 256 from 120 sums', '3', f'{found}', found == STEPS)


def sindy_example() -> OwnExample:
    """Brunton, Proctor, Kutz, PNAS 113, 2016: the seven coefficients of the Lorenz system."""
    import pysindy

    def lorenz(_: float, x: Array) -> list[float]:
        return [10.0 * (x[1] - x[0]), x[0] * (28.0 - x[2]) - x[1], x[0] * x[1] - 8.0 / 3.0 * x[2]]

    time = np.arange(0.0, 10.0, 0.002)
    path = solve_ivp(lorenz, (0.0, 10.0), (-8.0, 8.0, 27.0), t_eval=time, rtol=1e-9, atol=1e-9).y.T
    optimiser = pysindy.EnsembleOptimizer(opt=pysindy.STLSQ(threshold=0.5), bagging=True)
    squares = pysindy.PolynomialLibrary(degree=2)
    model = pysindy.SINDy(optimizer=optimiser, feature_library=squares).fit(path, t=0.002)
    found = np.asarray(model.coefficients())
    true = np.zeros((3, 10))
    true[0, 1:3], true[1, (1, 2, 6)], true[2, (3, 5)] = (-10, 10), (28, -1, -1), (-8 / 3, 1)
    error = float(np.max(np.abs(found - true)))
    gave = f'{np.count_nonzero(found)}, off by {error:.2g}'
    return OwnExample('Lorenz system', '7 terms within 0.05', gave, error < 0.05)


def _pursuit(design: Array, target: Array, terms: tuple[Term, ...]) -> list[int]:
    """Places of the chosen columns of a design (M, K) for targets (M, signals)."""
    count, signals = target.shape
    shows = np.array([[s in term.signals for s in range(signals)] for term in terms])
    free = [design.T.copy() for _ in range(signals)]
    left = target.T.copy()
    chosen: list[int] = []
    for _ in range(STEPS):
        gains = np.zeros(len(terms))
        for s in range(signals):
            power = np.maximum(np.sum(free[s] ** 2, axis=1), 1e-9)
            whole = max(float(left[s] @ left[s]), 1e-9)
            share = np.clip((free[s] @ left[s]) ** 2 / power / whole, 0.0, 1.0 - 1e-12)
            gains += shows[:, s] * (-0.5 * count * np.log1p(-share) - 0.5 * np.log(count))
        best = int(np.argmax(gains))
        if gains[best] <= np.log(count):
            break
        chosen.append(best)
        for s in map(int, np.flatnonzero(shows[best])):
            unit = free[s][best] / max(float(np.linalg.norm(free[s][best])), 1e-9)
            left[s] -= (unit @ left[s]) * unit
            free[s] -= np.outer(free[s] @ unit, unit)
    return chosen


def _ensemble(design: Array, target: Array, threshold: float) -> Array:
    """Coefficients (signals, K)."""
    import pysindy

    optimiser = pysindy.EnsembleOptimizer(
        opt=pysindy.STLSQ(threshold=threshold, alpha=RIDGE * len(design)),
        bagging=True,
        n_models=MODELS,
    )
    # pysindy draws from numpy's global generator: it is seeded, and left as it was found.
    state = np.random.get_state()  # noqa: NPY002
    np.random.seed(0)  # noqa: NPY002
    try:
        with warnings.catch_warnings():
            # A threshold that leaves nothing is one of those that are tried.
            warnings.simplefilter('ignore')
            optimiser.fit(design, target)
    finally:
        np.random.set_state(state)  # noqa: NPY002
    return np.array(optimiser.coef_)


def _strongest(
    problem: Problem, terms: tuple[Term, ...], design: Array, weights: Array
) -> Statement | None:
    """The name that carries most, if the model predicts held-out blocks."""
    held = problem.held_out
    size = np.sqrt(np.mean(problem.residuals**2, axis=0))
    before = np.sum((problem.residuals[held] / size) ** 2, axis=1)
    left = problem.residuals[held] - design[held] @ weights.T
    after = np.sum((left / size) ** 2, axis=1)
    carried: dict[str, float] = {}
    for k, term in enumerate(terms):
        carried[term.name] = carried.get(term.name, 0.0) + float(np.sum(weights[:, k] ** 2))
    best = max(carried, key=lambda name: carried[name])
    if carried[best] == 0.0 or not predicts(problem.time[held], before, after):
        return None
    return problem.says(best)
