"""One fit of several recordings of a rig whose tube is bent differently in each.

What a device is like is one number for all recordings. Wires and joint hardly change from one shape
of the tube to the next: their numbers scatter a little around a common mean, which the data of all
recordings determine (partial pooling: Gelman, Hill, Data Analysis Using Regression and
Multilevel/Hierarchical Models, Cambridge University Press 2007, ch. 12). Only what a bent sheath
does to a wire is each recording's own.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.effect import Stage
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.layout import (
    CAPSTAN_EXPONENT,
    FRICTION_PROFILE,
    MOTOR_BANDWIDTH,
    MOTOR_DAMPING_RATIO,
    PRETENSION_PROFILE,
    PROFILE_TERMS,
)
from endoscope_explain.fit import STEP, Fit, JointModel, bounded_step, central_jacobian
from endoscope_explain.free_parameters import LEAD, FreeParameter

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SPREAD = 0.1
"""Scatter of a pooled coordinate from one shape of the tube to another: ten per cent."""
FIRST_SPREAD = 0.5
"""Scatter that is allowed at first, so that a recording finds its way to the others."""

_OF_A_DEVICE = frozenset({MOTOR_BANDWIDTH, MOTOR_DAMPING_RATIO}) | {
    place
    for definition in CATALOGUE.values()
    if definition.stage in (Stage.ACTUATOR, Stage.SENSING)
    for place in definition.places
}
_OF_A_SHAPE = frozenset(
    {
        CAPSTAN_EXPONENT,
        PRETENSION_PROFILE,
        *range(FRICTION_PROFILE, FRICTION_PROFILE + PROFILE_TERMS),
        *(p for e in CATALOGUE.values() if e.traits.of_shape for p in e.places),
    }
)


@dataclass(frozen=True)
class _Effort:
    """How long a fit goes on.

    Attributes
    ----------
    iterations : int
    tolerance : float
        Least share by which a step lowers the cost.
    steps : tuple of float
        Difference steps, one after the other: the misfit is rough on a small scale, and a longer
        step looks over that.
    """

    iterations: int
    tolerance: float
    steps: tuple[float, ...]


ROUGH = _Effort(12, 1e-3, (10.0 * STEP,))
ON_THE_WAY = _Effort(20, 1e-3, (STEP, 10.0 * STEP))
THOROUGH = _Effort(30, 1e-4, (STEP, 10.0 * STEP, 60.0 * STEP))


@dataclass(frozen=True)
class _Layout:
    """Where the coordinates of all recordings lie in one vector.

    Attributes
    ----------
    columns : tuple of array
        Of each recording, the place of each of its free parameters; tied ones share theirs.
    pools : tuple of array
        Places of parameters that scatter around a common mean.
    low, high : array (N,)
        Bounds.
    """

    columns: tuple[Indices, ...]
    pools: tuple[Indices, ...]
    low: Array
    high: Array


def fit_together(
    models: Sequence[JointModel],
    starts: Sequence[Array],
    *,
    rough: bool = False,
) -> list[Fit]:
    """Fit all recordings of a rig together.

    Parameters
    ----------
    models : sequence of JointModel
        Of each recording, with the parameters of devices free.
    starts : sequence of array (n,)
        Coordinates to start from; those of devices start from their median.
    rough : bool
        Whether to stop early: to tell which effect is the better one, few digits are enough.

    Returns
    -------
    list of Fit
        Of each recording; the cost is its own, without what it lies away from the others.
    """
    layout = _layout(models)
    whole = np.zeros(len(layout.low))
    for place in range(len(whole)):
        found = [s[c == place] for s, c in zip(starts, layout.columns, strict=True)]
        whole[place] = np.median(np.concatenate(found))
    whole = np.clip(whole, layout.low, layout.high)
    if rough:
        whole = _descend(models, layout, whole, SPREAD, ROUGH)
    else:
        whole = _descend(models, layout, whole, FIRST_SPREAD, ON_THE_WAY)
        whole = _descend(models, layout, whole, SPREAD, THOROUGH)
    return _fits(models, layout, whole, STEP)


def with_common_numbers(fits: Sequence[Fit]) -> list[Array]:
    """Coordinates of each recording with pooled ones at the median of all recordings."""
    layout, whole = _laid_out(fits)
    for pool in layout.pools:
        whole[pool] = np.median(whole[pool])
    return [whole[columns] for columns in layout.columns]


def told_alone(fits: Sequence[Fit]) -> list[Fit]:
    """Each recording's fit as it can be gone on with without the others.

    Parameters
    ----------
    fits : sequence of Fit
        Of `fit_together`.

    Returns
    -------
    list of Fit
        Devices are held as found; a pooled parameter has the others' mean and scatter for a prior.
    """
    layout, whole = _laid_out(fits)
    means = {int(place): float(np.mean(whole[pool])) for pool in layout.pools for place in pool}
    alone = []
    for found, columns in zip(fits, layout.columns, strict=True):
        model = found.model
        base, _ = model.packed(found.theta)
        kept = [k for k, item in enumerate(model.free) if item.index not in _OF_A_DEVICE]
        free = tuple(_drawn_to(model.free[k], means.get(int(columns[k]))) for k in kept)
        told = replace(model, base=base, free=free)
        theta = found.theta[kept]
        cost = told.cost(found.residuals, theta)
        alone.append(Fit(told, theta, found.residuals, found.jacobian[:, kept], cost))
    return alone


def _laid_out(fits: Sequence[Fit]) -> tuple[_Layout, Array]:
    layout = _layout([f.model for f in fits])
    whole = np.zeros(len(layout.low))
    for found, columns in zip(fits, layout.columns, strict=True):
        whole[columns] = found.theta
    return layout, whole


def _drawn_to(item: FreeParameter, mean: float | None) -> FreeParameter:
    """The parameter with the prior that it has, times that of the other recordings if any."""
    if mean is None:
        return item
    own = 0.0 if math.isinf(item.spread) else item.spread**-2
    others = SPREAD**-2
    return replace(
        item,
        mean=(own * item.mean + others * mean) / (own + others),
        spread=(own + others) ** -0.5,
    )


def _layout(models: Sequence[JointModel]) -> _Layout:
    tied: dict[int, int] = {}
    pools: dict[int, list[int]] = {}
    columns: list[Indices] = []
    low: list[float] = []
    high: list[float] = []
    for model in models:
        lowest, highest = model.bounds()
        own = []
        for k, item in enumerate(model.free):
            if item.index in tied:
                own.append(tied[item.index])
                continue
            place = len(low)
            low.append(float(lowest[k]))
            high.append(float(highest[k]))
            own.append(place)
            if item.index == LEAD or item.index in _OF_A_DEVICE:
                tied[item.index] = place
            elif item.index not in _OF_A_SHAPE:
                pools.setdefault(item.index, []).append(place)
        columns.append(np.array(own, dtype=np.int64))
    return _Layout(
        tuple(columns),
        tuple(np.array(p, dtype=np.int64) for p in pools.values() if len(p) > 1),
        np.array(low),
        np.array(high),
    )


def _descend(
    models: Sequence[JointModel],
    layout: _Layout,
    whole: Array,
    spread: float,
    effort: _Effort,
) -> Array:
    """Levenberg-Marquardt on all coordinates; a longer difference step where it does not go on."""

    def cost_of(at: Array) -> float:
        cost = 0.0
        for model, columns in zip(models, layout.columns, strict=True):
            cost += model.cost(model.residuals(at[columns]), at[columns])
        for pool in layout.pools:
            cost += 0.5 * float(np.sum((at[pool] - np.mean(at[pool])) ** 2)) / spread**2
        return cost

    cost = cost_of(whole)
    damping, steps = 1e-4, effort.steps
    for _ in range(effort.iterations):
        fits = _fits(models, layout, whole, steps[0])
        normal, gradient = _normal_equations(fits, layout, whole, spread)
        scale = np.maximum(np.diag(normal), 1e-9)
        before = cost
        damping = min(damping, 1e-2)
        for _ in range(7):
            step = bounded_step(
                normal + damping * np.diag(scale), gradient, whole, layout.low, layout.high
            )
            trial = whole + step
            trial_cost = cost_of(trial)
            if trial_cost < cost:
                whole, cost = trial, trial_cost
                damping = max(damping / 10.0, 1e-7)
                break
            damping = max(damping * 10.0, 1e-3)
        if before - cost < effort.tolerance * before:
            steps = steps[1:]
            if not steps:
                break
    return whole


def _fits(models: Sequence[JointModel], layout: _Layout, whole: Array, step: float) -> list[Fit]:
    """Each recording at its part of the coordinates, with its derivative by differences."""
    fits = []
    for model, columns in zip(models, layout.columns, strict=True):
        theta = whole[columns]
        residuals = model.residuals(theta)
        derivative = central_jacobian(model, theta, step)
        fits.append(Fit(model, theta, residuals, derivative, model.cost(residuals, theta)))
    return fits


def _normal_equations(
    fits: Sequence[Fit], layout: _Layout, whole: Array, spread: float
) -> tuple[Array, Array]:
    normal = np.zeros((len(whole), len(whole)))
    gradient = np.zeros(len(whole))
    for found, columns in zip(fits, layout.columns, strict=True):
        weight = found.model.prior_weight()
        derivative = found.jacobian
        normal[np.ix_(columns, columns)] += derivative.T @ derivative + np.diag(weight**2)
        gradient[columns] += derivative.T @ found.residuals
        gradient[columns] += weight * found.model.prior(found.theta)
    for pool in layout.pools:
        together = (np.eye(len(pool)) - 1.0 / len(pool)) / spread**2
        normal[np.ix_(pool, pool)] += together
        gradient[pool] += together @ whole[pool]
    return normal, gradient
