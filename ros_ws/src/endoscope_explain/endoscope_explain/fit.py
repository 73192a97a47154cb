"""Output-error least squares of one joint: Levenberg-Marquardt with bounds and priors."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import CATALOGUE, showing
from endoscope_explain.evaluate import residuals, simulate_joint
from endoscope_explain.free_parameters import LEAD, FreeParameter
from endoscope_explain.observation import JointObservation

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

CLOCK_RATE = showing(Symptom.CLOCK_RATE)
STEP = 5.0e-4
"""Difference step of a coordinate: a motor that stalls leaves a valley of the misfit so bent that
one of 1 % ends a fit at its wall."""
WIDE_STEP = 0.1
"""With sticking and slipping, the times of the slips jump with the parameters, and so do the
residuals: a wide difference looks over the jumps."""
REACH = 0.7
"""Largest step of a coordinate: further away the derivative says little."""
SLOW = 0.2
"""An approximate derivative is renewed once a step lowers the cost by less than this share."""


@dataclass(frozen=True)
class JointModel:
    """One joint with some of its numbers free.

    Attributes
    ----------
    observation : JointObservation
    base : array (parameters,)
        Packed parameters; the free ones are replaced.
    flags : array (flags,) of bool
    free : tuple of FreeParameter
    wide_step : float
        Difference step of a coordinate where an effect makes the misfit rugged.
    """

    observation: JointObservation
    base: Array
    flags: Flags
    free: tuple[FreeParameter, ...]
    wide_step: float = WIDE_STEP

    def packed(self, theta: Array) -> tuple[Array, float]:
        """Packed parameters and reading lead at the coordinates `theta` (n,)."""
        parameters = self.base.copy()
        lead = 0.0
        for item, coordinate in zip(self.free, theta, strict=True):
            if item.index == LEAD:
                lead = item.value(float(coordinate))
            else:
                parameters[item.index] = item.value(float(coordinate))
        return parameters, lead

    def begun_at(self, theta: Array) -> Array:
        """Coordinates `theta` of the first free parameters; the others as `base` has them."""
        others = self.free[len(theta) :]
        return np.concatenate(
            [theta, [item.coordinate(float(self.base[item.index])) for item in others]]
        )

    def holding(self, places: range, theta: Array) -> tuple['JointModel', Array]:
        """The model with the packed `places` held as in `base`, and the coordinates left free."""
        kept = [k for k, item in enumerate(self.free) if item.index not in places]
        return replace(self, free=tuple(self.free[k] for k in kept)), theta[kept]

    def residuals(self, theta: Array) -> Array:
        """Residuals in noise units, all channels in a row."""
        parameters, lead = self.packed(theta)
        skew = parameters[CLOCK_RATE.first_parameter] if self.flags[CLOCK_RATE.flag] else 0.0
        outputs = simulate_joint(self.observation, parameters, self.flags)
        return residuals(self.observation, outputs, lead, skew)

    @property
    def step(self) -> float:
        """Difference step of a logarithmic coordinate."""
        rugged = any(e.traits.rugged and self.flags[e.flag] for e in CATALOGUE.values())
        return self.wide_step if rugged else STEP

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest coordinates."""
        return (
            np.array([item.coordinate(item.low) for item in self.free]),
            np.array([item.coordinate(item.high) for item in self.free]),
        )

    def prior(self, theta: Array) -> Array:
        """Deviations from the priors' means in spreads."""
        return np.array(
            [
                0.0 if math.isinf(item.spread) else (coordinate - item.mean) / item.spread
                for item, coordinate in zip(self.free, theta, strict=True)
            ]
        )

    def prior_weight(self) -> Array:
        """Inverse spreads."""
        return np.array([1.0 / item.spread for item in self.free])

    def cost(self, residuals: Array, theta: Array) -> float:
        """Half squares of residuals at the coordinates `theta`, prior included."""
        return 0.5 * float(residuals @ residuals + np.sum(self.prior(theta) ** 2))


@dataclass(frozen=True)
class Fit:
    """A fitted joint.

    Attributes
    ----------
    model : JointModel
    theta : array (n,)
        Coordinates of the free parameters.
    residuals : array (size,)
        Unweighted, in noise units.
    jacobian : array (size, n)
        Of the residuals, at or near `theta`.
    cost : float
        Half weighted squares, prior included.
    """

    model: JointModel
    theta: Array
    residuals: Array
    jacobian: Array = field(repr=False)
    cost: float


def without_effect(found: Fit, effect_id: str) -> tuple[JointModel, Array]:
    """Model and first coordinates (n,) of a fit that has lost one of its effects."""
    definition = CATALOGUE[effect_id]
    flags = found.model.flags.copy()
    flags[definition.flag] = False
    return replace(found.model, flags=flags).holding(definition.places, found.theta)


def jacobian(model: JointModel, theta: Array, at: Array, columns: list[int] | None = None) -> Array:
    """Difference quotients of the residuals `at` the coordinates `theta`.

    Parameters
    ----------
    model : JointModel
    theta : array (n,)
    at : array (size,)
        Residuals at `theta`.
    columns : list of int, optional
        Coordinates to differentiate by; all if not given.

    Returns
    -------
    array (size, n or len(columns))
    """
    low, high = model.bounds()
    columns = list(range(len(theta))) if columns is None else columns
    result = np.empty((len(at), len(columns)))
    for i, c in enumerate(columns):
        moved = theta.copy()
        step = model.step if model.free[c].logarithmic else 2.0 * model.step
        step = min(step, 0.5 * (high[c] - low[c]))
        step = step if theta[c] + step <= high[c] else -step
        moved[c] += step
        result[:, i] = (model.residuals(moved) - at) / (moved[c] - theta[c])
    return result


def central_jacobian(model: JointModel, theta: Array, step: float) -> Array:
    """Central difference quotients (size, n) of the residuals at `theta`, by `step` at least."""
    low, high = model.bounds()
    result = np.empty((model.observation.size, len(theta)))
    for k, item in enumerate(model.free):
        reach = max(step, model.step) * (1.0 if item.logarithmic else 2.0)
        below, above = theta.copy(), theta.copy()
        below[k] = max(theta[k] - reach, low[k])
        above[k] = min(theta[k] + reach, high[k])
        moved = model.residuals(above) - model.residuals(below)
        result[:, k] = moved / (above[k] - below[k])
    return result


def bounded_step(hessian: Array, gradient: Array, theta: Array, low: Array, high: Array) -> Array:
    """Newton step within bounds and `REACH`: coordinates that hit one are fixed, one by one."""
    low, high = np.maximum(low, theta - REACH), np.minimum(high, theta + REACH)
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


def fit(
    model: JointModel,
    start: Array,
    weight: Array | None = None,
    iterations: int = 8,
    tolerance: float = 1e-3,
    known_jacobian: Array | None = None,
) -> Fit:
    """Fit the free parameters of a joint.

    Parameters
    ----------
    model : JointModel
    start : array (n,)
        Coordinates to start from.
    weight : array (size,), optional
        Factors on the residuals (at most 1 where an error of form is allowed for).
    iterations : int
        Largest number of steps.
    tolerance : float
        Stop when a step lowers the cost by less than this share.
    known_jacobian : array (size, n), optional
        Used for the first step.

    Returns
    -------
    Fit
    """
    weight = np.ones(model.observation.size) if weight is None else weight
    low, high = model.bounds()
    theta = np.clip(start, low, high)
    prior_weight = model.prior_weight()
    current = model.residuals(theta)

    def cost_of(values: Array, at: Array) -> float:
        return 0.5 * float(np.sum((weight * values) ** 2) + np.sum(model.prior(at) ** 2))

    cost = cost_of(current, theta)
    damping = 1e-4
    derivative = (
        jacobian(model, theta, current) if known_jacobian is None else known_jacobian.copy()
    )
    exact = known_jacobian is None
    for _ in range(iterations):
        weighted = derivative * weight[:, None]
        gradient = weighted.T @ (weight * current) + prior_weight * model.prior(theta)
        normal = weighted.T @ weighted + np.diag(prior_weight**2)
        scale = np.maximum(np.diag(normal), 1e-9)
        before, accepted = cost, False
        for _ in range(6 if exact else 2):
            step = bounded_step(normal + damping * np.diag(scale), gradient, theta, low, high)
            length = float(step @ step)
            if length < 1e-14:
                break
            trial = model.residuals(theta + step)
            trial_cost = cost_of(trial, theta + step)
            if trial_cost < cost:
                # Broyden's rank-one update saves the simulations of a new derivative.
                derivative += np.outer((trial - current - derivative @ step) / length, step)
                theta, current, cost = theta + step, trial, trial_cost
                damping = max(damping / 10.0, 1e-7)
                accepted = True
                break
            damping = max(damping * 10.0, 1e-3)
        gained = before - cost
        if exact and (not accepted or gained < tolerance * before):
            break
        exact = gained < SLOW * before
        if exact:
            derivative = jacobian(model, theta, current)
    if not exact:
        derivative = jacobian(model, theta, current)
    return Fit(model, theta, current, derivative, cost)
