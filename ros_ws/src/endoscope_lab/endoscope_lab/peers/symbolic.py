"""Symbolic regression of the loudest residual, named by the state that the formula leans on."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from endoscope_lab.concealed.judge import Statement
from endoscope_lab.peers.library import BENDING, EFFORT, NEGATIVE, POSITIVE
from endoscope_lab.peers.problem import OwnExample, Problem, predicts

Array = NDArray[np.float64]
Predictor = Callable[[Array], Array]
Regression = Callable[[Array, Array, float], Predictor]
"""From states (M, K), a target (M,) and an effort to a formula."""

EVERY_TH = 4
"""Samples that are fitted: searches of formulas are made for some hundreds of points."""
GENERATIONS = 200
EFFORT_OF_CASE = 0.25
"""Share of the generations of an own example that is spent on a case."""
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


def operon_example() -> OwnExample:
    """Poly-10 of Poli (EuroGP 2003), which comes with pyoperon."""
    x = np.random.default_rng(1).uniform(-1.0, 1.0, (500, 10))
    pairs = x[:, 0] * x[:, 1] + x[:, 2] * x[:, 3] + x[:, 4] * x[:, 5]
    y = pairs + x[:, 0] * x[:, 6] * x[:, 8] + x[:, 2] * x[:, 5] * x[:, 9]
    regression = partial(operon, symbols='add,sub,mul,div,constant,variable')
    return _example('Poly-10', regression, x, y)


def _example(what: str, regression: Regression, x: Array, y: Array) -> OwnExample:
    half = len(x) // 2
    left = y[half:] - regression(x[:half], y[:half], 1.0)(x[half:])
    unexplained = float(np.mean(left**2) / np.var(y[half:]))
    return OwnExample(what, 'all but 1e-4', f'{unexplained:.1e}', unexplained < 1e-4)


by_operon = partial(named_by, operon)
