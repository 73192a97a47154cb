"""Which function of which state at which place explains best what a fit leaves.

All families are screened by one linear solve each; those that promise most are refitted in the
simulator. Their evidence is Laplace's: the likelihood with each channel's variance estimated anew,
times the prior of the coefficients, times the volume that is left of it (MacKay, Neural Computation
4(3), 1992).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.acting import FLAGS_OF_FUNCTIONS
from endoscope_core.physics.functions.interpolation import HIGH, LOW, NODES, VALUES
from endoscope_core.physics.functions.place import Shape
from endoscope_explain.families.family import COEFFICIENTS, Family, family_at, visited_ranges
from endoscope_explain.fit.free_parameters import FreeParameter
from endoscope_explain.fit.model import Fit, JointModel, fit
from endoscope_explain.fit.simulated_joint import simulate_joint
from endoscope_explain.parallel import parallel_map
from endoscope_explain.repeated_motion import motion_repeats
from endoscope_explain.screen import Unexplained, unexplained

Array = NDArray[np.float64]

PRIOR_SHARE = 0.1
"""Share of a channel's signal by which a function drawn from the prior moves the channel that it
moves most."""
REFITTED = 5
"""Families that are refitted, of all that were screened."""
ITERATIONS = 10
SETTLING, SETTLED = 40, 1e-4
"""Steps of the best one's fit, at most, and the share of the cost below which it stands."""
_COORDINATE = 10.0
"""Coefficients in a coordinate of the fit, whose steps suit logarithms."""
_FURTHEST = 6.0
"""Standard deviations of the prior."""
_TRIAL = 1e-3
"""Share of the largest value that a function may have, of the one that is tried."""


@dataclass(frozen=True)
class FunctionModel(JointModel):
    """A joint with a function of a family more; its coefficients are the last free parameters."""

    family: Family | None = None

    def packed(self, theta: Array) -> tuple[Array, float]:
        """Packed parameters and reading lead at the coordinates `theta` (n,)."""
        parameters, lead = super().packed(theta)
        assert self.family is not None
        place = self.family.place
        values = self.family.basis @ (_COORDINATE * theta[-COEFFICIENTS:])
        if place.never_negative:
            values = np.maximum(values, 0.0)
        first = place.first_parameter + VALUES
        parameters[first : first + NODES] = np.clip(values, -place.largest, place.largest)
        return parameters, lead


@dataclass(frozen=True)
class FunctionFit:
    """A family fitted to a joint.

    Attributes
    ----------
    family : Family
    fit : Fit
    gain : float
        Logarithm of the evidence over that without a function.
    values : array (NODES,)
        The function at the family's nodes.
    covariance : array (K, K)
        Of the coefficients, the other numbers free.
    """

    family: Family
    fit: Fit
    gain: float
    values: Array
    covariance: Array

    @property
    def deviation(self) -> Array:
        """Standard deviation of the function at its nodes (NODES,)."""
        spread = np.einsum('nk,kl,nl->n', self.family.basis, self.covariance, self.family.basis)
        return np.sqrt(np.maximum(spread, 0.0))


def best_functions(found: Fit, jobs: int) -> list[FunctionFit]:
    """Functions that explain most of what a fit leaves, best first.

    Parameters
    ----------
    found : Fit
        Without any function.
    jobs : int
        Tasks side by side.

    Returns
    -------
    list of FunctionFit
    """
    weight = _weights(found)
    left = unexplained(found, weight)

    def screened(family: Family) -> tuple[float, Family] | None:
        return _screened(left, family, weight)

    families = list(_families(found))
    promised = [p for p in parallel_map(screened, families, jobs) if p is not None]
    promised.sort(key=lambda p: -p[0])
    likely = [family for gain, family in promised[:REFITTED] if gain > 0.0]
    models = [_model(found, family) for family in likely]
    begun = np.concatenate([found.theta, np.zeros(COEFFICIENTS)])
    fits = parallel_map(lambda m: fit(m, begun, weight=weight, iterations=ITERATIONS), models, jobs)
    functions = [_judged(found, f, weight) for f in fits]
    functions.sort(key=lambda f: -f.gain)
    if functions:
        functions[0] = _judged(found, _settled(functions[0].fit, weight), weight)
    return functions


def _families(found: Fit) -> Iterable[Family]:
    parameters, _ = found.model.packed(found.theta)
    outputs = simulate_joint(found.model.observation, parameters, found.model.flags)
    ranges = visited_ranges(found.model.observation, parameters, outputs)
    repeats = motion_repeats(found.model.observation)
    for place in FUNCTIONS.values():
        if place.shape is Shape.PERIODIC or (place.traits.depends_on_time and not repeats):
            continue
        family = family_at(place, ranges[place.argument.symbol, place.argument.unit])
        if family is not None:
            yield family


def _weights(found: Fit) -> Array:
    """Inverse of what each channel is off by, in its noise; the noise itself where that is less."""
    weights = np.empty(len(found.residuals))
    for part in found.model.observation.slices():
        weights[part] = 1.0 / max(1.0, float(np.sqrt(np.mean(found.residuals[part] ** 2))))
    return weights


def _model(found: Fit, family: Family) -> FunctionModel:
    place, base = family.place, found.model.base.copy()
    base[place.first_parameter + LOW] = family.low
    base[place.first_parameter + HIGH] = family.high
    flags: NDArray[Any] = found.model.flags.astype(FLAGS_OF_FUNCTIONS)
    flags[place.flag] = True
    reach = _FURTHEST
    coefficients = tuple(
        FreeParameter(
            place.first_parameter + VALUES, f'coefficient_{k}', False, _COORDINATE, -reach, reach,
            spread=1.0 / _COORDINATE,
        )
        for k in range(COEFFICIENTS)
    )  # fmt: skip
    free = found.model.free + coefficients
    return FunctionModel(found.model.observation, base, flags, free, family=family)


def _answers(found: Fit, family: Family) -> Array:
    """Change of the residuals (size, K) by each coefficient."""
    model = _model(found, family)
    columns = np.empty((len(found.residuals), COEFFICIENTS))
    begun = np.concatenate([found.theta, np.zeros(COEFFICIENTS)])
    for k in range(COEFFICIENTS):
        moved = begun.copy()
        moved[len(found.theta) + k] = 1.0 / _COORDINATE
        columns[:, k] = model.residuals(moved) - found.residuals
    return columns


def _screened(
    background: Unexplained, family: Family, weight: Array
) -> tuple[float, Family] | None:
    found, span = background.fit, background.span
    trial = family.scaled(_TRIAL * family.place.largest)
    answers = _answers(found, trial) * weight[:, None]
    size = _relative_size(found, answers, weight)
    if size <= 0.0:
        return None
    amplitude = PRIOR_SHARE / size
    columns = np.vstack([amplitude * answers, np.zeros((len(found.theta), COEFFICIENTS))])
    columns -= span @ (span.T @ columns)
    towards = columns.T @ background.left
    precision = np.eye(COEFFICIENTS) + columns.T @ columns
    gain = 0.5 * float(towards @ np.linalg.solve(precision, towards))
    _, volume = np.linalg.slogdet(precision)
    return gain - 0.5 * float(volume), trial.scaled(amplitude)


def _relative_size(found: Fit, answers: Array, weight: Array) -> float:
    """By what share of its signal the channel moves that moves most, rms over the prior."""
    shares = [0.0]
    observation = found.model.observation
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        signal = (channel.value - np.mean(channel.value)) / channel.noise * weight[part]
        size = float(np.sum(signal**2))
        if size > 0.0:
            shares.append(float(np.sqrt(np.sum(answers[part] ** 2) / size)))
    return max(shares)


def _settled(found: Fit, weight: Array) -> Fit:
    """Go on until nothing moves any more, from here and from the plant as described.

    What was missing has bent the other numbers, and they may stay in the corner that it bent them
    into.
    """
    model = found.model
    described = found.theta.copy()
    described[:-COEFFICIENTS] = [item.mean for item in model.free[:-COEFFICIENTS]]

    def settled(theta: Array) -> Fit:
        return fit(model, theta, weight, SETTLING, SETTLED)

    def cost(each: Fit) -> float:
        return model.cost(weight * each.residuals, each.theta)

    return min((settled(theta) for theta in (found.theta, described)), key=cost)


def _judged(found: Fit, fitted: Fit, weight: Array) -> FunctionFit:
    model = fitted.model
    assert isinstance(model, FunctionModel)
    family = model.family
    assert family is not None
    weighted = fitted.jacobian * weight[:, None]
    precision = weighted.T @ weighted + np.diag(model.prior_weight() ** 2)
    covariance = np.linalg.inv(precision)[-COEFFICIENTS:, -COEFFICIENTS:] * _COORDINATE**2
    _, volume = np.linalg.slogdet(covariance)
    coefficients = _COORDINATE * fitted.theta[-COEFFICIENTS:]
    gain = _likelihood(fitted) - _likelihood(found)
    gain += 0.5 * float(volume) - 0.5 * float(coefficients @ coefficients)
    before = found.model.prior(found.theta)
    after = model.prior(fitted.theta)[:-COEFFICIENTS]
    gain += 0.5 * float(before @ before - after @ after)
    packed, _ = model.packed(fitted.theta)
    first = family.place.first_parameter + VALUES
    cost = model.cost(fitted.residuals, fitted.theta)
    return FunctionFit(
        family, replace(fitted, cost=cost), gain, packed[first : first + NODES], covariance
    )


def _likelihood(found: Fit) -> float:
    """Logarithm of the likelihood with the variance of each channel as it is, not below noise."""
    total = 0.0
    for part in found.model.observation.slices():
        squares = float(np.mean(found.residuals[part] ** 2))
        count = part.stop - part.start
        total -= 0.5 * count * (np.log(max(squares, 1.0)) + squares / max(squares, 1.0))
    return total
