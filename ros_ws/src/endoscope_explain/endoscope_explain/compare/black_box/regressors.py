"""The two black boxes: a Gaussian process and a small neural network, many outputs at once."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GAUSSIAN_PROCESS_POINTS = 500
TUNING_POINTS = 150
NETWORK_WIDTH = 32
NETWORK_STEPS = 500
NETWORK_DECAY = 2e-2
"""Weight of the squared weights: of 1e-4 to 3e-2 what leaves least in held-out blocks."""


class Regressor(Protocol):
    """Anything that predicts outputs (M, K) from features (M, F)."""

    def predict(self, features: Array) -> Array:
        """Return the outputs."""
        ...


class GaussianProcess:
    """Gaussian process with one length scale for each feature, on an even subsample.

    Its length scales are tuned by marginal likelihood on a coarser subsample still; Rasmussen,
    Williams, Gaussian Processes for Machine Learning, 2006, ch. 5.

    Parameters
    ----------
    features : array (M, F)
    outputs : array (M, K)
    """

    def __init__(self, features: Array, outputs: Array) -> None:
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, WhiteKernel

        self._scaling = _Scaling(features, outputs)
        x, y = self._scaling.scaled(features, outputs)
        few, many = (
            np.linspace(0, len(x) - 1, min(count, len(x))).astype(int)
            for count in (TUNING_POINTS, GAUSSIAN_PROCESS_POINTS)
        )
        kernel = RBF(np.full(x.shape[1], 3.0), (0.1, 1e3)) + WhiteKernel(0.1, (1e-3, 2.0))
        tuning = GaussianProcessRegressor(kernel, optimizer=_few_steps)
        tuning.fit(x[few], y[few])
        self._process = GaussianProcessRegressor(tuning.kernel_, optimizer=None)
        self._process.fit(x[many], y[many])

    def predict(self, features: Array) -> Array:
        """Return the posterior mean (M, K)."""
        mean = self._process.predict(self._scaling.scaled_features(features))
        return self._scaling.unscaled(np.asarray(mean).reshape(len(features), -1))


class NeuralNetwork:
    """Two hidden layers of tanh, trained by Adam with weight decay on all samples.

    Parameters
    ----------
    features : array (M, F)
    outputs : array (M, K)
    seed : int
        Of the initial weights.
    """

    def __init__(self, features: Array, outputs: Array, seed: int = 0) -> None:
        from sklearn.neural_network import MLPRegressor

        self._scaling = _Scaling(features, outputs)
        x, y = self._scaling.scaled(features, outputs)
        self._network = MLPRegressor(
            hidden_layer_sizes=(NETWORK_WIDTH, NETWORK_WIDTH),
            activation='tanh',
            alpha=NETWORK_DECAY * len(x),
            batch_size=len(x),
            learning_rate_init=1e-2,
            max_iter=NETWORK_STEPS,
            n_iter_no_change=NETWORK_STEPS,
            random_state=seed,
        )
        self._network.fit(x, y)

    def predict(self, features: Array) -> Array:
        """Return the network's outputs (M, K)."""
        found = self._network.predict(self._scaling.scaled_features(features))
        return self._scaling.unscaled(np.asarray(found).reshape(len(features), -1))


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


class _Scaling:
    def __init__(self, features: Array, outputs: Array) -> None:
        self._x_mean, self._x_spread = features.mean(axis=0), features.std(axis=0) + 1e-9
        self._y_mean, self._y_spread = outputs.mean(axis=0), outputs.std(axis=0) + 1e-12

    def scaled_features(self, features: Array) -> Array:
        # Beyond what was seen a black box knows nothing: it stays at the edge.
        return np.asarray(np.clip((features - self._x_mean) / self._x_spread, -4.0, 4.0))

    def scaled(self, features: Array, outputs: Array) -> tuple[Array, Array]:
        return self.scaled_features(features), (outputs - self._y_mean) / self._y_spread

    def unscaled(self, outputs: Array) -> Array:
        return np.asarray(outputs * self._y_spread + self._y_mean)


def _few_steps(objective: object, start: Array, bounds: Array) -> tuple[Array, float]:
    from scipy.optimize import minimize

    found = minimize(
        objective, start, jac=True, bounds=bounds, method='L-BFGS-B', options={'maxiter': 10}
    )
    return found.x, found.fun
