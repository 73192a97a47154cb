"""The two black boxes: a Gaussian process and a small neural network, many outputs at once."""

import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Predictor = Callable[[Array], Array]
"""Outputs (M, K) of features (M, F)."""

GAUSSIAN_PROCESS_POINTS = 500
TUNING_POINTS = 150
NETWORK_WIDTH = 32
NETWORK_STEPS = 500
NETWORK_DECAY = 2e-2
"""Weight of the squared weights: of 1e-4 to 3e-2 what leaves least in held-out blocks."""
EDGE = 4.0
"""Beyond so many standard deviations a black box knows nothing: it stays at the edge."""


def trained(kind: str, features: Array, outputs: Array) -> Predictor:
    """Train a black box of `KINDS` on features (M, F) and outputs (M, K)."""
    from sklearn.preprocessing import StandardScaler

    inputs, targets = StandardScaler().fit(features), StandardScaler().fit(outputs)

    def scaled(features: Array) -> Array:
        return np.clip(inputs.transform(features), -EDGE, EDGE)

    model = KINDS[kind](scaled(features), targets.transform(outputs))

    def predict(features: Array) -> Array:
        found = np.asarray(model.predict(scaled(features))).reshape(len(features), -1)
        return np.asarray(targets.inverse_transform(found))

    return predict


@contextmanager
def training() -> Iterator[None]:
    """What black boxes are trained in, side by side or one after the other."""
    from sklearn.exceptions import ConvergenceWarning
    from threadpoolctl import threadpool_limits

    # Matrices this small are slower on several threads than on one.
    with warnings.catch_warnings(), threadpool_limits(1):
        # A length scale at its bound is a feature that does not matter, and so many steps of the
        # network are meant.
        warnings.simplefilter('ignore', ConvergenceWarning)
        yield


def _gaussian_process(x: Array, y: Array) -> Any:
    """One length scale for each feature, on an even subsample."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, WhiteKernel

    # The length scales are tuned by marginal likelihood on a coarser subsample still; Rasmussen,
    # Williams, Gaussian Processes for Machine Learning, 2006, ch. 5.
    few, many = (
        np.linspace(0, len(x) - 1, min(count, len(x))).astype(int)
        for count in (TUNING_POINTS, GAUSSIAN_PROCESS_POINTS)
    )
    kernel = RBF(np.full(x.shape[1], 3.0), (0.1, 1e3)) + WhiteKernel(0.1, (1e-3, 2.0))
    tuning = GaussianProcessRegressor(kernel, optimizer=_few_steps).fit(x[few], y[few])
    return GaussianProcessRegressor(tuning.kernel_, optimizer=None).fit(x[many], y[many])


def _few_steps(objective: object, start: Array, bounds: Array) -> tuple[Array, float]:
    from scipy.optimize import minimize

    found = minimize(
        objective, start, jac=True, bounds=bounds, method='L-BFGS-B', options={'maxiter': 10}
    )
    return found.x, found.fun


def _neural_network(x: Array, y: Array) -> Any:
    """Two hidden layers of tanh, trained by Adam with weight decay on all samples."""
    from sklearn.neural_network import MLPRegressor

    return MLPRegressor(
        hidden_layer_sizes=(NETWORK_WIDTH, NETWORK_WIDTH),
        activation='tanh',
        alpha=NETWORK_DECAY * len(x),
        batch_size=len(x),
        learning_rate_init=1e-2,
        max_iter=NETWORK_STEPS,
        n_iter_no_change=NETWORK_STEPS,
        random_state=0,
    ).fit(x, y)


KINDS: Mapping[str, Callable[[Array, Array], Any]] = {
    'gaussian_process': _gaussian_process,
    'neural_network': _neural_network,
}
"""Black boxes by name: each fits scaled features (M, F) and outputs (M, K)."""
