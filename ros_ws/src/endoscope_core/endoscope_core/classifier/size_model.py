"""Backlash size of a tube, with its uncertainty, regressed from wire tensions."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cho_solve, cholesky, solve_triangular

from endoscope_core.classifier.classification import CellReadings
from endoscope_core.classifier.tension_features import (
    PERIOD,
    log_courses,
    roughness,
    variance_of_fewer_readings,
)

Array = NDArray[np.float64]
Number = float | Array
"""Read from a file it is an array of shape ()."""

COMPONENTS = 16
STEPS = 120
_RATE = 0.08
_MOMENTA = (0.9, 0.999)
_JITTER = 1e-9
_LEAST = 1e-6
_ROUNDING = 1e-6


@dataclass(frozen=True)
class SizeEstimate:
    """What the model makes of R recordings of J joints.

    Parameters
    ----------
    size, deviation : ndarray, shape (R,)
        Backlash size in rad, mean of the joints, and the standard deviation of its error as the
        model takes it, before calibration on recordings held out.
    strangeness : ndarray, shape (R, 3)
        Natural logarithms of how far the tensions are from those that the model knows, the worst
        joint or wire of each recording; see `STRANGENESS`.
    """

    size: Array
    deviation: Array
    strangeness: Array


STRANGENESS = (
    'the tensions do not take the course that they take in a known tube',
    'the tensions are too far from those of all known tubes',
    "a load cell's noise is not what it was in known tubes",
)
"""What each number of `SizeEstimate.strangeness` says when it is too large."""


@dataclass(frozen=True, eq=False)
class BacklashSizeModel:
    """Gaussian process on principal components of the tension courses of one joint.

    Friction acts on tension as a factor (Euler-Eytelwein), so that the courses are read as
    logarithms (`log_courses`). They lie near a surface of few dimensions: capstan exponent, its
    spread along the tube, pretension, stiffness and friction of the joint are all that varies. The
    first principal components, whitened, span it. The size is a Gaussian process of them with a
    linear and a squared-exponential covariance, a length for each component, and noise; all of
    these maximise the marginal likelihood (Rasmussen, Williams, Gaussian Processes for Machine
    Learning, 2006, sections 2.3, 5.1 and 5.4). All joints share one model, so that each recording
    teaches it twice. What the components leave out of a course, and how far out they are, tell
    tensions of another kind.

    Parameters
    ----------
    centre : ndarray, shape (C,)
        Mean course.
    basis : ndarray, shape (K, C)
        Principal components.
    spread : ndarray, shape (K,)
        Standard deviation of the courses along each.
    scores : ndarray, shape (M, K)
        The M courses that it is fitted to, in components, whitened.
    target : ndarray, shape (M,)
        Their backlash sizes in rad.
    lengths : ndarray, shape (K,)
        Of the squared-exponential covariance.
    linear, height, noise : float
        Standard deviations of the size in rad: for a unit of a component, of the
        squared-exponential part, and of what tensions do not tell.
    rest : float
        Rms of what the components leave out of a known course.
    quiet : float
        Noise of a load cell in N rms.
    """

    centre: Array
    basis: Array
    spread: Array
    scores: Array
    target: Array
    lengths: Array
    linear: Number
    height: Number
    noise: Number
    rest: Number
    quiet: Number

    @staticmethod
    def shapes(known: int, course: int, components: int) -> dict[str, tuple[int, ...]]:
        """Shape of each of its arrays, for M known courses of length C in K components."""
        return {
            'centre': (course,),
            'basis': (components, course),
            'spread': (components,),
            'scores': (known, components),
            'target': (known,),
            'lengths': (components,),
            **dict.fromkeys(('linear', 'height', 'noise', 'rest', 'quiet'), ()),
        }

    def require_fitted(self) -> None:
        """Refuse numbers that no fit gives.

        Directions of a singular value decomposition are orthonormal, and whitened scores have a
        mean square of one: to rounding, whatever the model was fitted to.

        Raises
        ------
        ValueError
            They are not, or a known size is no angle of a tube.
        """
        # Numbers of a damaged file may be too large to be squared: then they are not these.
        with np.errstate(over='ignore', invalid='ignore'):
            products = self.basis @ self.basis.T
            squares = np.mean(np.square(self.scores), axis=0)
        if not np.allclose(products, np.eye(len(self.basis)), atol=_ROUNDING):
            raise ValueError('the components are not orthonormal')
        if not np.allclose(squares, 1.0, atol=_ROUNDING):
            raise ValueError('the scores are not whitened')
        if not np.all((self.target >= 0.0) & (self.target <= 2.0 * np.pi)):
            raise ValueError('the known sizes are no angles')

    def estimate(self, tension: ArrayLike, cells: CellReadings | None = None) -> SizeEstimate:
        """Sizes of recordings (R, N, 2 J) in N at 1 kHz.

        Where the cells were read less often, their noise is that of the readings, and what fewer
        readings add to the noise of the courses is no strangeness of the tube.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the model's numbers make no covariance.
        """
        factor, weights = self._conditioned
        tension = np.asarray(tension, dtype=np.float64)
        course = log_courses(tension)
        scores, rest = components(course, self.centre, self.basis, self.spread)
        flat = scores.reshape(-1, scores.shape[-1])
        known = self.covariance(flat, self.scores)
        told = np.sum(np.square(solve_triangular(factor, known.T, lower=True)), axis=0)
        alone = self.height**2 + self.linear**2 * np.sum(np.square(flat), axis=1)
        size = (known @ weights + np.mean(self.target)).reshape(scores.shape[:2])
        deviation = np.sqrt(np.maximum(alone - told, 0.0) + self.noise**2)
        # The joints of a rig are alike, and so are the model's errors on them: they do not average.
        deviation = deviation.reshape(scores.shape[:2]).mean(axis=1)
        return SizeEstimate(
            size.mean(axis=1), deviation, self._strangeness(tension, course, scores, rest, cells)
        )

    def covariance(self, a: Array, b: Array) -> Array:
        """Covariance (A, B) in rad^2 of the sizes at whitened components (A, K) and (B, K)."""
        return self.height**2 * self._bump(a, b) + self.linear**2 * (a @ b.T)

    def log_likelihood(self) -> tuple[float, Array]:
        """Of the known sizes, less a constant; and its gradient.

        Returns
        -------
        value : float
        gradient : ndarray, shape (K + 3,)
            By the logarithms of `lengths`, `linear`, `height` and `noise` (section 5.4.1).
        """
        factor, weights = self._conditioned
        target = self.target - np.mean(self.target)
        value = -0.5 * target @ weights - np.sum(np.log(np.diag(factor)))
        inverse = cho_solve((factor, True), np.eye(len(factor)))
        slope = 0.5 * (np.outer(weights, weights) - inverse)
        noise = 2.0 * self.noise**2 * np.trace(slope)
        slope[np.diag_indices_from(slope)] += _JITTER * np.mean(np.diag(slope))
        bent = self.height**2 * slope * self._bump(self.scores, self.scores)
        squares = np.sum(bent, axis=1) @ np.square(self.scores)
        products = np.sum(self.scores * (bent @ self.scores), axis=0)
        lengths = 2.0 * (squares - products) / self.lengths**2
        linear = 2.0 * self.linear**2 * np.sum(self.scores * (slope @ self.scores))
        return float(value), np.array([*lengths, linear, 2.0 * np.sum(bent), noise])

    @cached_property
    def _conditioned(self) -> tuple[Array, Array]:
        """Cholesky factor of the known sizes' covariance, and its solution for these sizes."""
        known = self.covariance(self.scores, self.scores)
        known[np.diag_indices_from(known)] += self.noise**2 + _JITTER * np.mean(np.diag(known))
        factor = cholesky(known, lower=True)
        return factor, cho_solve((factor, True), self.target - np.mean(self.target))

    def _bump(self, a: Array, b: Array) -> Array:
        x, y = a / self.lengths, b / self.lengths
        ends = np.sum(np.square(x), axis=1)[:, None] + np.sum(np.square(y), axis=1)
        return np.exp(-0.5 * np.maximum(ends - 2.0 * (x @ y.T), 0.0))

    def _strangeness(
        self,
        tension: Array,
        course: Array,
        scores: Array,
        rest: Array,
        cells: CellReadings | None,
    ) -> Array:
        rms, interval = roughness(tension), PERIOD
        if cells is not None:
            rms, interval = np.reshape(cells.noise, (1, *rms.shape[1:])), cells.interval
        added = variance_of_fewer_readings(course, rms, interval)
        of_basis = np.square(self.basis)
        unknown = rest**2 - np.mean(added * (1.0 - of_basis.sum(axis=0)), axis=-1)
        far = np.mean(scores**2, axis=-1) - np.mean(added @ of_basis.T / self.spread**2, axis=-1)
        noise = np.abs(np.log(np.maximum(rms / self.quiet, _LEAST))).max(axis=(1, 2))
        return np.stack(
            [
                _log_root(unknown / self.rest**2).max(axis=1),
                _log_root(far).max(axis=1),
                np.broadcast_to(noise, len(tension)),
            ],
            axis=1,
        )


def fitted_size_model(
    tension: ArrayLike, joint_size: ArrayLike, steps: int = STEPS
) -> BacklashSizeModel:
    """A model fitted to recordings of known sizes.

    Parameters
    ----------
    tension : ndarray, shape (R, N, 2 J)
        N at 1 kHz.
    joint_size : ndarray, shape (R, J)
        rad.
    steps : int
        Of the search for the greatest likelihood.
    """
    tension = np.asarray(tension, dtype=np.float64)
    courses = log_courses(tension)
    course = courses.reshape(-1, courses.shape[-1])
    target = np.ravel(joint_size).astype(np.float64)
    centre = course.mean(axis=0)
    _, strengths, directions = np.linalg.svd(course - centre, full_matrices=False)
    kept = min(COMPONENTS, len(course) - 1, course.shape[1])
    basis, spread = directions[:kept].copy(), strengths[:kept] / np.sqrt(len(course))
    scores, rest = components(course, centre, basis, spread)
    unit = np.std(target, ddof=1)
    first = BacklashSizeModel(
        centre=centre,
        basis=basis,
        spread=spread,
        scores=scores,
        target=target,
        lengths=np.full(kept, np.exp(1.5)),
        linear=0.5 * unit,
        height=unit,
        noise=0.02 * unit,
        rest=np.sqrt(np.mean(np.square(rest))),
        quiet=np.exp(np.mean(np.log(roughness(tension)))),
    )
    return _likeliest(first, steps)


def _likeliest(model: BacklashSizeModel, steps: int) -> BacklashSizeModel:
    """Search for the greatest likelihood by Adam (Kingma, Ba, ICLR 2015, algorithm 1).

    It ends after so many steps rather than where the likelihood is greatest: lengths of components
    that say nothing of the size would go to infinity.
    """
    logarithms = np.log([*model.lengths, model.linear, model.height, model.noise])
    mean, square = np.zeros_like(logarithms), np.zeros_like(logarithms)
    slow, slower = _MOMENTA
    for step in range(1, steps + 1):
        _, uphill = model.log_likelihood()
        mean = slow * mean + (1.0 - slow) * uphill
        square = slower * square + (1.0 - slower) * uphill**2
        root = np.sqrt(square / (1.0 - slower**step)) + 1e-8
        logarithms = logarithms + _RATE * mean / (1.0 - slow**step) / root
        *lengths, linear, height, noise = np.exp(logarithms)
        model = replace(model, lengths=np.array(lengths), linear=linear, height=height, noise=noise)
    return model


def components(course: Array, centre: Array, basis: Array, spread: Array) -> tuple[Array, Array]:
    """Whitened components of courses, and the rms of what they leave out."""
    deviation = course - centre
    raw = deviation @ basis.T
    rest = np.sqrt(np.mean(np.square(deviation - raw @ basis), axis=-1))
    return raw / spread, rest


def _log_root(square: Array) -> Array:
    return 0.5 * np.log(np.maximum(square, _LEAST))
