"""Fits side by side."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit.model import Fit, JointModel
from endoscope_explain.parallel import parallel_map

Array = NDArray[np.float64]


def parallel_fits(
    fitted: Callable[[int], Fit], models: Sequence[JointModel], jobs: int
) -> list[Fit]:
    """Fits of several models; only their numbers travel between processes, not the recordings.

    Parameters
    ----------
    fitted : callable
        Fits the model of an index.
    models : sequence of JointModel
    jobs : int
        Number of processes.

    Returns
    -------
    list of Fit
        In the order of the models.
    """

    def numbers(index: int) -> tuple[Array, Array, Array, float]:
        done = fitted(index)
        return done.theta, done.residuals, done.jacobian, done.cost

    found = parallel_map(numbers, range(len(models)), jobs)
    return [Fit(model, *values) for model, values in zip(models, found, strict=True)]
