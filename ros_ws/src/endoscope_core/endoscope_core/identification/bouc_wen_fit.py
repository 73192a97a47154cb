"""Bouc-Wen parameters from recordings, in two steps.

First the model of the transmission, equations 3 and 4 driven by the motor: what the recording
shows. Then the feed-forward, equations 4 and 5 driven by the desired angle: the parameters with
which it makes *that model* follow. The paper puts the first set straight into equation 5; but there
`h` is driven by the desired angle instead of the motor's, which is further by the very dead zone
that is to be crossed, so that the state turns too late at every reversal.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution, lsq_linear

from endoscope_core.errors import EndoscopeError
from endoscope_core.hysteresis import BoucWenParameters
from endoscope_core.hysteresis.bouc_wen import GREATEST_ALPHA, GREATEST_LAG, SMALLEST_ALPHA
from endoscope_core.hysteresis.bouc_wen_kernel import bouc_wen_normalised_path

Array = NDArray[np.float64]

SHORTEST_TRAVEL = float(np.deg2rad(2.0))
LONGEST_TRAVEL = float(np.deg2rad(90.0))
RHO_BOUNDS = (-0.95, 1.0)
EXPONENT_BOUNDS = (1.0, 4.0)
_SMALLEST_MOTION = float(np.deg2rad(1.0))


class IdentificationError(EndoscopeError, ValueError):
    """A recording from which nothing can be identified."""


@dataclass(frozen=True)
class Recording:
    """Motor and joint of one recording, evenly sampled.

    Parameters
    ----------
    driver : ndarray, shape (N,)
        Joint-equivalent motor angle in rad.
    actual : ndarray, shape (N,)
        Bending angle in rad.
    rested : bool
        Whether it begins at rest and without memory, so that `h` begins at zero.
    """

    driver: Array
    actual: Array
    rested: bool = True


@dataclass(frozen=True)
class ModelFit:
    """A Bouc-Wen model of a transmission.

    Parameters
    ----------
    parameters : BoucWenParameters
    rmse : float
        rad, of modelled less measured angle, offsets removed.
    evaluations : int
        Simulations that the search took.
    """

    parameters: BoucWenParameters
    rmse: float
    evaluations: int

    def __str__(self) -> str:
        rows = [f'  {name:<6}{value:10.4f}' for name, value in self.parameters.to_dict().items()]
        return '\n'.join([f'Bouc-Wen model, {np.rad2deg(self.rmse):.2f} deg rms', *rows])


def fit_model(recordings: Sequence[Recording], seed: int = 0) -> ModelFit:
    """Fit equations 3 and 4 to one or more recordings of the same tube or class.

    For given shape (`travel`, `rho`, `n`) and initial state, `alpha`, the lag and an offset for
    each recording enter linearly and follow from bounded least squares; only the shape is searched
    (variable projection, Golub and Pereyra 1973). The search is differential evolution (Storn and
    Price 1997), a relative of the papers' genetic algorithm: it needs no start, does not stay in
    the local minima that `n` and `travel` make, keeps to its box, and repeats with its seed;
    L-BFGS-B, bounded too, then polishes.

    Parameters
    ----------
    recordings : sequence of Recording
    seed : int
        Of the search.

    Raises
    ------
    IdentificationError
        If there is no recording, one is empty or not finite, or the motor or the joint hardly
        moves.
    """
    _check(recordings)
    starts = [k for k, recording in enumerate(recordings) if not recording.rested]

    def states(shape: Array) -> list[Array]:
        travel, rho, n = np.exp(shape[0]), shape[1], shape[2]
        first = np.zeros(len(recordings))
        first[starts] = shape[3:]
        return [
            bouc_wen_normalised_path(recording.driver, y0, travel, rho, n)
            for recording, y0 in zip(recordings, first, strict=True)
        ]

    def cost(shape: Array) -> float:
        return _linear_part(recordings, states(shape))[2]

    bounds = [(np.log(SHORTEST_TRAVEL), np.log(LONGEST_TRAVEL)), RHO_BOUNDS, EXPONENT_BOUNDS]
    bounds += [(-1.0, 1.0)] * len(starts)
    found = differential_evolution(
        cost, bounds, rng=np.random.default_rng(seed), popsize=8, maxiter=60, tol=1e-5
    )
    alpha, lag, mean_square = _linear_part(recordings, states(found.x))
    parameters = BoucWenParameters.from_shape(
        alpha, lag, float(np.exp(found.x[0])), float(found.x[1]), float(found.x[2])
    )
    return ModelFit(parameters, float(np.sqrt(mean_square)), int(found.nfev))


def _linear_part(
    recordings: Sequence[Recording], states: Sequence[Array]
) -> tuple[float, float, float]:
    """Best `alpha`, lag and the mean square that they leave."""
    columns = [
        np.stack([r.driver - np.mean(r.driver), np.mean(y) - y], axis=1)
        for r, y in zip(recordings, states, strict=True)
    ]
    target = np.concatenate([r.actual - np.mean(r.actual) for r in recordings])
    matrix = np.concatenate(columns)
    gram = matrix.T @ matrix + 1e-12 * np.eye(2)
    side = matrix.T @ target
    solution = np.linalg.solve(gram, side)
    low = np.array([SMALLEST_ALPHA, 0.0])
    high = np.array([GREATEST_ALPHA, GREATEST_LAG])
    if np.any(solution < low) or np.any(solution > high):
        root = np.linalg.cholesky(gram).T
        solution = lsq_linear(root, np.linalg.solve(root.T, side), (low, high)).x
        solution = np.clip(solution, low, high)
    residual = target - matrix @ solution
    return float(solution[0]), float(solution[1]), float(np.mean(residual**2))


def _check(recordings: Sequence[Recording]) -> None:
    if not recordings:
        raise IdentificationError('there is no recording to identify from')
    for k, recording in enumerate(recordings):
        for name, values in (('motor', recording.driver), ('bending', recording.actual)):
            if len(values) < 100 or not np.all(np.isfinite(values)):
                raise IdentificationError(
                    f'recording {k}: the {name} angle has {len(values)} samples, of which all must '
                    'be finite and at least 100 there'
                )
            if np.ptp(values) < _SMALLEST_MOTION:
                raise IdentificationError(
                    f'recording {k}: the {name} angle moves by less than 1 deg, which shows no '
                    'hysteresis; record a calibration or commissioning motion'
                )
        if len(recording.driver) != len(recording.actual):
            raise IdentificationError(f'recording {k}: motor and bending differ in length')
