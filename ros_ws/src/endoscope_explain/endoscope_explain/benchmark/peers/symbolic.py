"""pyoperon: symbolic regression of the loudest residual, named by the state that it leans on."""

import numpy as np

from endoscope_explain.benchmark.peers.term_library import Problem

SECONDS = 10
SYMBOLS = 'add,sub,mul,sin,exp,tanh,abs,constant,variable'
EFFECT_OF_STATE = {
    't': ('pretension_loss', 'tracker_drift'),
    'm': ('cogging', 'tracker_bias'),
    'dm': ('transport_delay', 'transport_delay'),
    'ddm': ('actuator_lag', 'actuator_lag'),
    'q': ('gravity', 'tracker_distortion'),
    'dq': ('joint_backlash', 'tracker_delay'),
    'ddq': ('joint_inertia', 'joint_inertia'),
    'ta': ('load_cell_gain', 'wire_stiffening'),
    'tb': ('load_cell_gain', 'wire_stiffening'),
    'other': ('cross_coupling', 'cross_coupling'),
    'v': ('viscous_friction', 'viscous_friction'),
    'lagging': ('wire_creep', 'wire_creep'),
    'slid': ('friction_run_in', 'friction_run_in'),
    'play': ('distributed_friction', 'presliding_shape'),
}
"""What a residual of a wire, and of the angle, that depends on a state stands for."""


def name_by_symbolic_regression(problem: Problem, seed: int = 1) -> str:
    """Name the effect that goes with the state whose shuffling spoils the formula most.

    Burlacu, Kronberger, Kommenda, GECCO 2020 (Operon).

    Parameters
    ----------
    problem : Problem
    seed : int

    Returns
    -------
    str
    """
    from pyoperon.sklearn import SymbolicRegressor

    loudest = int(np.argmax(problem.residuals.std(axis=0)))
    target = problem.residuals[:, loudest]
    target = target / (target.std() + 1e-9)
    names = list(problem.states)
    states = np.stack([problem.states[name] for name in names], axis=1)
    regressor = SymbolicRegressor(
        allowed_symbols=SYMBOLS,
        max_length=20,
        population_size=500,
        pool_size=500,
        optimizer_iterations=3,
        n_threads=1,
        max_time=SECONDS,
        random_state=seed,
    )
    regressor.fit(states, target)
    error = float(np.mean((regressor.predict(states) - target) ** 2))
    rng = np.random.default_rng(seed)
    spoilt = []
    for column in range(len(names)):
        shuffled = states.copy()
        shuffled[:, column] = rng.permutation(shuffled[:, column])
        spoilt.append(float(np.mean((regressor.predict(shuffled) - target) ** 2)) - error)
    best = int(np.argmax(spoilt))
    if spoilt[best] <= 0.0:
        return 'nothing'
    return EFFECT_OF_STATE[names[best]][1 if loudest == 2 else 0]
