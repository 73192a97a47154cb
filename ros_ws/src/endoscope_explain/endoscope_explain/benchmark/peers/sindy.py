"""pysindy: ensembles of sequentially thresholded least squares on the library of terms."""

import warnings

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.benchmark.peers.term_library import Problem

Array = NDArray[np.float64]

THRESHOLDS = (0.02, 0.05, 0.1, 0.2)
"""Tried as shares of the residual's spread; the one that predicts left-out blocks best is kept."""
MODELS = 20


def name_by_sindy(problem: Problem, seed: int = 0) -> str:
    """Name the effect whose terms carry most of the sparse model.

    Fasel, Kutz, Brunton, Brunton, Proc. R. Soc. A 478, 2022.

    Parameters
    ----------
    problem : Problem
    seed : int
        Of the ensemble's bootstrap.

    Returns
    -------
    str
    """
    spread = problem.residuals.std(axis=0) + 1e-9
    target = problem.residuals / spread
    design = np.stack([term.values for term in problem.terms], axis=1)
    blocks = np.arange(len(target)) * 8 // len(target)
    train = blocks % 4 != 3
    scored = []
    for threshold in THRESHOLDS:
        weights = _fit(design[train], target[train], threshold, seed)
        scored.append((float(np.mean((target - design @ weights.T)[~train] ** 2)), threshold))
    weights = _fit(design, target, min(scored)[1], seed)
    carried: dict[str, float] = {}
    for index, term in enumerate(problem.terms):
        part = float(sum((spread[c] * weights[c, index]) ** 2 for c in term.signals))
        carried[term.effect] = carried.get(term.effect, 0.0) + part
    best = max(carried, key=lambda k: carried[k])
    return best if carried[best] > 0.0 else 'nothing'


def _fit(design: Array, target: Array, threshold: float, seed: int) -> Array:
    import pysindy

    optimiser = pysindy.EnsembleOptimizer(
        opt=pysindy.STLSQ(threshold=threshold, alpha=1e-2), bagging=True, n_models=MODELS
    )
    # pysindy draws from numpy's global generator: it is seeded, and left as it was found.
    state = np.random.get_state()  # noqa: NPY002
    np.random.seed(seed)  # noqa: NPY002
    try:
        with warnings.catch_warnings():
            # A threshold that leaves nothing is one of those that are tried.
            warnings.simplefilter('ignore')
            optimiser.fit(design, target)
    finally:
        np.random.set_state(state)  # noqa: NPY002
    return np.asarray(optimiser.coef_)
