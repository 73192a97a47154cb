"""The two black boxes: a Gaussian process and a small neural network, many outputs at once."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import torch

Array = NDArray[np.float64]

GAUSSIAN_PROCESS_POINTS = 500
TUNING_POINTS = 150
NETWORK_WIDTH = 32
NETWORK_STEPS = 500


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
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, WhiteKernel
        from threadpoolctl import threadpool_limits

        self._scaling = _Scaling(features, outputs)
        x, y = self._scaling.scaled(features, outputs)
        few, many = (
            np.linspace(0, len(x) - 1, min(count, len(x))).astype(int)
            for count in (TUNING_POINTS, GAUSSIAN_PROCESS_POINTS)
        )
        kernel = RBF(np.full(x.shape[1], 3.0), (0.1, 1e3)) + WhiteKernel(0.1, (1e-3, 2.0))
        tuning = GaussianProcessRegressor(kernel, optimizer=_few_steps)
        # Matrices this small are slower on several threads than on one.
        with warnings.catch_warnings(), threadpool_limits(1):
            # A length scale at its bound is a feature that does not matter.
            warnings.simplefilter('ignore', ConvergenceWarning)
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
        import torch
        from torch import nn

        self._scaling = _Scaling(features, outputs)
        x, y = (
            torch.tensor(a, dtype=torch.float32) for a in self._scaling.scaled(features, outputs)
        )
        # A generator of its own: nobody else's random numbers are touched.
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self._network = nn.Sequential(
                nn.Linear(x.shape[1], NETWORK_WIDTH),
                nn.Tanh(),
                nn.Linear(NETWORK_WIDTH, NETWORK_WIDTH),
                nn.Tanh(),
                nn.Linear(NETWORK_WIDTH, y.shape[1]),
            )
        with _one_thread():
            self._train(x, y)

    def _train(self, x: 'torch.Tensor', y: 'torch.Tensor') -> None:
        import torch
        from torch import nn

        optimiser = torch.optim.AdamW(self._network.parameters(), lr=1e-2, weight_decay=1e-2)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, NETWORK_STEPS)
        for _ in range(NETWORK_STEPS):
            optimiser.zero_grad()
            nn.functional.mse_loss(self._network(x), y).backward()
            optimiser.step()
            schedule.step()

    def predict(self, features: Array) -> Array:
        """Return the network's outputs (M, K)."""
        import torch

        x = torch.tensor(self._scaling.scaled_features(features), dtype=torch.float32)
        with torch.no_grad():
            return self._scaling.unscaled(self._network(x).numpy().astype(float))


@contextmanager
def _one_thread() -> Iterator[None]:
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


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
