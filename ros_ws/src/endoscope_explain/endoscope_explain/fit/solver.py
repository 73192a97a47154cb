"""Levenberg-Marquardt within bounds: the one optimiser of all fits.

Steps are Newton's with damping (Marquardt, J. SIAM 11(2), 1963), cut at bounds and at the distance
over which a derivative says anything. Between exact derivatives, which cost a simulation for every
coordinate, Broyden's rank-one update follows the steps (Broyden, Math. Comp. 19, 1965).
"""

from dataclasses import dataclass, replace
from enum import Enum, StrEnum, auto
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP = 5.0e-4
"""Difference step of a coordinate: a motor that stalls leaves a valley of the misfit so bent that
one of 1 % ends a fit at its wall."""
LONGEST_STEP = 0.7
"""Largest step of a coordinate: further away the derivative says little."""
TRUSTED = 0.5
"""Share of the decrease that an approximate derivative promised below which it is renewed: half way
between a derivative that foretells what a step does and one that says nothing."""
TRIES, TRIES_BY_ESTIMATE = 6, 2
"""How often a step that does not lower the cost is shortened, by the quality of the derivative."""
_FIRST_DAMPING, _LEAST_DAMPING, _RESTARTED_DAMPING = 1e-4, 1e-7, 1e-3
_LARGEST_AT_FIRST = 1e-2
_NO_STEP = 1e-14


class Renewal(Enum):
    """When the derivative is worked out again."""

    NEVER = auto()
    WHEN_WRONG = auto()
    ALWAYS = auto()


class Ended(StrEnum):
    """Why a fit went no further."""

    CONVERGED = 'the last step gained less than the tolerance'
    NO_STEP = 'no step lowers the misfit'
    SPENT = 'the limit on steps was reached'


@dataclass(frozen=True)
class Effort:
    """How long a fit goes on."""

    iterations: int = 8  # largest number of steps, not counting those by an estimate
    tolerance: float = 1e-3  # stop when a step lowers the cost by less than this share
    # Difference steps, each used until it leads no further: the misfit is rough on a small scale,
    # and a longer step looks over that.
    strides: tuple[float, ...] = (STEP,)
    renewal: Renewal = Renewal.WHEN_WRONG


class Objective[R, D](Protocol):
    """Half a sum of squares over coordinates, which may have priors among them.

    `R` are its residuals, `D` their derivative, in whatever form suits it.
    """

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates (n,)."""

    def evaluate(self, theta: Array) -> tuple[R, float]:
        """Residuals and cost at the coordinates (n,)."""

    def derivative(self, theta: Array, residuals: R, stride: float) -> D:
        """Difference quotients of the residuals."""

    def normal_equations(self, theta: Array, residuals: R, derivative: D) -> tuple[Array, Array]:
        """Matrix (n, n) and gradient (n,) of the cost."""

    def updated(self, derivative: D, step: Array, before: R, after: R) -> D:
        """The derivative after Broyden's update for a step (n,); not asked for by `ALWAYS`."""


@dataclass(frozen=True)
class Secants:
    """A derivative (size, n), and what rank-one updates have added to it since.

    The updates stay apart, and the matrix of the normal equations follows them, so that a step
    costs a product with vectors instead of one with a matrix as tall as the data.
    """

    exact: Array  # (size, n)
    squared: Array  # (size,), weights of the residuals, squared
    gram: Array  # (n, n), of the weighted derivative with its updates
    updates: tuple[tuple[Array, Array], ...] = ()  # each the outer product of (size,) and (n,)

    @classmethod
    def at(cls, exact: Array, weight: Array | None) -> 'Secants':
        """A derivative (size, n) before any update, of residuals to be weighted by `weight`."""
        squared = np.ones(len(exact)) if weight is None else weight**2
        weighted = exact if weight is None else exact * weight[:, None]
        return cls(exact, squared, weighted.T @ weighted)

    @property
    def whole(self) -> Array:
        """The derivative (size, n) with its updates."""
        if not self.updates:
            return self.exact
        tall, wide = (np.stack(part, axis=1) for part in zip(*self.updates, strict=True))
        return np.asarray(self.exact + tall @ wide.T)

    def towards(self, residuals: Array) -> Array:
        """Gradient (n,) of half the weighted squares of residuals (size,)."""
        weighted = self.squared * residuals
        found = self.exact.T @ weighted
        for tall, wide in self.updates:
            found += wide * float(tall @ weighted)
        return np.asarray(found)

    def updated(self, step: Array, before: Array, after: Array) -> 'Secants':
        """The derivative that foretells what a step (n,) did (Broyden, Math. Comp. 19, 1965)."""
        foretold = self.exact @ step
        for tall, wide in self.updates:
            foretold += tall * float(wide @ step)
        missed = (after - before - foretold) / float(step @ step)
        across = np.outer(self.towards(missed), step)
        own = float(missed @ (self.squared * missed))
        gram = self.gram + across + across.T + own * np.outer(step, step)
        return replace(self, gram=gram, updates=(*self.updates, (missed, step)))


@dataclass(frozen=True)
class Minimum[R, D]:
    """Where a fit ended."""

    theta: Array  # (n,)
    residuals: R
    derivative: D  # at `theta`; near it where it is never renewed
    cost: float
    steps: int  # that were tried
    ended: Ended


def minimise[R, D](
    objective: Objective[R, D], start: Array, effort: Effort, known: D | None = None
) -> Minimum[R, D]:
    """Go down from `start` (n,), by a derivative that is known near it for the first step."""
    low, high = objective.bounds()
    theta = np.clip(start, low, high)
    residuals, cost = objective.evaluate(theta)
    strides, renewal = effort.strides, effort.renewal
    exact = known is None
    derivative = objective.derivative(theta, residuals, strides[0]) if known is None else known
    damping = _FIRST_DAMPING
    steps = iterations = estimated = 0
    ended = Ended.SPENT
    while iterations < effort.iterations:
        steps += 1
        # As many steps as there are coordinates cost what a derivative does.
        estimated = 0 if exact else estimated + 1
        iterations += exact or renewal is Renewal.NEVER
        damping = min(damping, _LARGEST_AT_FIRST) if exact else damping
        before, promised, accepted = cost, 0.0, False
        normal, gradient = objective.normal_equations(theta, residuals, derivative)
        for _ in range(1 if renewal is Renewal.NEVER else TRIES if exact else TRIES_BY_ESTIMATE):
            damped = normal + damping * np.diag(np.maximum(np.diag(normal), 1e-9))
            step = bounded_step(damped, gradient, theta, low, high)
            promised = -float(gradient @ step + 0.5 * step @ normal @ step)
            if float(step @ step) < _NO_STEP:
                break
            trial, trial_cost = objective.evaluate(theta + step)
            accepted = trial_cost < cost
            if renewal is Renewal.NEVER or (accepted and renewal is Renewal.WHEN_WRONG):
                derivative = objective.updated(derivative, step, residuals, trial)
            if accepted:
                theta, residuals, cost = theta + step, trial, trial_cost
                damping = max(damping / 10.0, _LEAST_DAMPING)
                break
            damping = max(damping * 10.0, _RESTARTED_DAMPING)
        if renewal is Renewal.NEVER:
            continue
        gained = before - cost
        if exact and (not accepted or gained < effort.tolerance * before):
            strides = strides[1:]
            if not strides:
                ended = Ended.CONVERGED if accepted else Ended.NO_STEP
                break
        foretold = accepted and gained >= max(TRUSTED * promised, effort.tolerance * before)
        exact = renewal is Renewal.ALWAYS or not foretold or estimated >= len(theta)
        if exact:
            derivative = objective.derivative(theta, residuals, strides[0])
    if not exact and renewal is not Renewal.NEVER:
        derivative = objective.derivative(theta, residuals, strides[0])
    return Minimum(theta, residuals, derivative, cost, steps, ended)


def bounded_step(hessian: Array, gradient: Array, theta: Array, low: Array, high: Array) -> Array:
    """Newton step within bounds and `LONGEST_STEP`; coordinates that hit one are fixed in turn."""
    low, high = np.maximum(low, theta - LONGEST_STEP), np.minimum(high, theta + LONGEST_STEP)
    free = np.ones(len(theta), dtype=bool)
    step = np.zeros(len(theta))
    for _ in range(len(theta) + 1):
        step[:] = 0.0
        fixed = ~free
        step[fixed] = np.where(gradient[fixed] > 0, low[fixed], high[fixed]) - theta[fixed]
        rhs = -gradient[free] - hessian[np.ix_(free, fixed)] @ step[fixed]
        step[free] = np.linalg.solve(hessian[np.ix_(free, free)], rhs)
        new = theta + step
        out = free & ((new < low - 1e-12) | (new > high + 1e-12))
        if not out.any():
            break
        worst = np.argmax(np.where(out, np.maximum(low - new, new - high), -1.0))
        gradient = gradient.copy()
        gradient[worst] = 1.0 if new[worst] < low[worst] else -1.0
        free[worst] = False
        if not free.any():
            break
    return np.clip(theta + step, low, high) - theta
