"""Symbolic regression of the loudest residual, named by the state that the formula leans on."""

import random
import warnings
from collections.abc import Callable
from copy import deepcopy
from functools import partial

import numpy as np
from numpy.typing import NDArray

from endoscope_benchmarks.concealed.judge import Statement
from endoscope_benchmarks.peers.problem import OwnExample, Problem, predicts
from endoscope_benchmarks.peers.term_library import BENDING, EFFORT, NEGATIVE, POSITIVE

Array = NDArray[np.float64]
Predictor = Callable[[Array], Array]
Regression = Callable[[Array, Array, float], Predictor]
"""From states (M, K), a target (M,) and an effort to a formula."""

EVERY_TH = 4
"""Samples that are fitted: searches of formulas are made for some hundreds of points."""
STEPS, GENERATIONS = 600, 200
EFFORT_OF_CASE = 0.25
"""Share of the steps and generations of an own example that is spent on a case."""
REAL = ('+', '-', '*', '/', 'pow2', 'pow3', 'exp', 'sin', 'cos', 'tanh', 'abs')
SYMBOLS = 'add,sub,mul,div,sin,exp,tanh,abs,constant,variable'
OF_PLANT = {
    't': 'length_of_time', 'u': 'command_of_command', 'e': 'servo_error_of_error',
    'm': 'pulley_of_shaft', 'dm': 'transport_delay', 'ddm': 'actuator_lag',
    'q': 'load_of_angle', 'dq': 'load_of_speed', 'ddq': 'joint_inertia',
    'v': 'exponent_of_speed', 'd': 'exponent_of_distance', 'ta': 'stiffness_of_tension',
    'tb': 'stiffness_of_tension', 'D': 'pulley_of_tension', 'other': 'load_of_other_angle',
}  # fmt: skip
"""What a residual that depends on a state stands for; T is left out, half the sum of ta and tb."""
OF_SENSOR = {
    (BENDING, 'q'): 'tracker_of_angle', (BENDING, 'other'): 'tracker_of_other_angle',
    (BENDING, 't'): 'tracker_of_time', (BENDING, 'dq'): 'tracker_delay',
    (POSITIVE, 'ta'): 'load_cell_pos_of_tension', (POSITIVE, 'tb'): 'load_cell_pos_of_other_wire',
    (POSITIVE, 't'): 'load_cell_pos_of_time', (NEGATIVE, 'tb'): 'load_cell_neg_of_tension',
    (NEGATIVE, 'ta'): 'load_cell_neg_of_other_wire', (NEGATIVE, 't'): 'load_cell_neg_of_time',
    (EFFORT, 'dm'): 'effort_of_speed',
}  # fmt: skip
"""The same where one sensor is to blame."""


def named_by(regression: Regression, problem: Problem) -> Statement | None:
    """Name what goes with the state whose shuffling spoils the formula most."""
    names = [n for n in OF_PLANT if n in problem.states and np.ptp(problem.states[n]) > 0.0]
    states = np.stack([problem.states[n] for n in names], axis=1)
    states /= np.sqrt(np.mean(states**2, axis=0))
    target = problem.residuals[:, problem.loudest]
    target = target / (target.std() + 1e-9)
    held = problem.held_out
    formula = regression(states[~held][::EVERY_TH], target[~held][::EVERY_TH], EFFORT_OF_CASE)
    with np.errstate(all='ignore'):
        left = target - formula(states)
        if not predicts(problem.time[held], target[held] ** 2, left[held] ** 2):
            return None
        draw = np.random.default_rng(1)
        spoilt = []
        for column in range(len(names)):
            shuffled = states.copy()
            shuffled[:, column] = draw.permutation(shuffled[:, column])
            spoilt.append(float(np.mean((target - formula(shuffled)) ** 2)))
    state = names[int(np.nanargmax(spoilt))]
    blamed = problem.sensor_to_blame
    place = OF_PLANT[state] if blamed is None else OF_SENSOR.get((blamed, state), OF_PLANT[state])
    return problem.says(place)


def operon(states: Array, target: Array, effort: float, symbols: str = SYMBOLS) -> Predictor:
    """Burlacu, Kronberger, Kommenda, GECCO 2020."""
    from pyoperon.sklearn import SymbolicRegressor

    generations = round(effort * GENERATIONS)
    found = SymbolicRegressor(
        allowed_symbols=symbols, max_length=50, population_size=1000, pool_size=1000,
        generations=generations, optimizer_iterations=5, n_threads=1, random_state=1,
    ).fit(states, target)  # fmt: skip
    return lambda x: np.asarray(found.predict(x))


def elite(states: Array, target: Array, effort: float) -> Predictor:
    """gp-elite: islands of genetic programming."""
    from gp_elite import symbolic_regression

    with warnings.catch_warnings():
        # Where the formula that it prints departs from its model; the model is what is used.
        warnings.filterwarnings('ignore', 'GP_ELITE', RuntimeWarning)
        generations = round(effort * 60)
        found = symbolic_regression(states, target, generations=generations, seed=0, parallel=False)
    return lambda x: np.asarray(found.predict(x))


def bayesian(states: Array, target: Array, effort: float) -> Predictor:
    """The Bayesian machine scientist: Guimera et al., Sci. Adv. 6, 2020, from AutoRA."""
    import pandas
    from autora.theorist.bms import Parallel, get_priors

    # It stops on complex numbers, so roots and logarithms are left out.
    prior, operations = get_priors()
    names = [f'x{k}' for k in range(states.shape[1])]
    random.seed(1)
    chain = Parallel(
        [1.2**k for k in range(10)], variables=names, parameters=['a0', 'a1'], seed=1,
        ops={each: operations[each] for each in REAL},
        prior_par={f'Nopi_{each}': prior[f'Nopi_{each}'] for each in REAL},
        x=pandas.DataFrame(states, columns=names), y=pandas.Series(target),
    )  # fmt: skip
    # Of the formulas that its Markov chain draws from their posterior, that of the shortest
    # description.
    best, shortest = chain.t1, np.inf
    for _ in range(round(effort * STEPS)):
        chain.mcmc_step()
        chain.tree_swap()
        if shortest > chain.t1.E:
            best, shortest = deepcopy(chain.t1), chain.t1.E
    return lambda x: np.asarray(best.predict(pandas.DataFrame(x, columns=names)))


def operon_example() -> OwnExample:
    """Poly-10 of Poli (EuroGP 2003), which comes with pyoperon."""
    x = np.random.default_rng(1).uniform(-1.0, 1.0, (500, 10))
    pairs = x[:, 0] * x[:, 1] + x[:, 2] * x[:, 3] + x[:, 4] * x[:, 5]
    y = pairs + x[:, 0] * x[:, 6] * x[:, 8] + x[:, 2] * x[:, 5] * x[:, 9]
    regression = partial(operon, symbols='add,sub,mul,div,constant,variable')
    return _example('Poly-10', regression, x, y)


def elite_example() -> OwnExample:
    """Of gp-elite's own page."""
    x = np.random.RandomState(0).uniform(1.0, 5.0, (400, 2))
    return _example('2 + 3 sqrt(a) - b/2', elite, x, 2.0 + 3.0 * np.sqrt(x[:, 0]) - 0.5 * x[:, 1])


def bayesian_example() -> OwnExample:
    """A formula of its own operations, without noise, as in the paper's first test."""
    x = np.random.default_rng(1).uniform(-2.0, 2.0, (200, 1))
    return _example('1.5 x^2 + sin(x)', bayesian, x, 1.5 * x[:, 0] ** 2 + np.sin(x[:, 0]))


def _example(what: str, regression: Regression, x: Array, y: Array) -> OwnExample:
    half = len(x) // 2
    left = y[half:] - regression(x[:half], y[:half], 1.0)(x[half:])
    unexplained = float(np.mean(left**2) / np.var(y[half:]))
    return OwnExample(what, 'all but 1e-4', f'{unexplained:.1e}', unexplained < 1e-4)


by_operon, by_elite, by_bayesian = (partial(named_by, r) for r in (operon, elite, bayesian))
