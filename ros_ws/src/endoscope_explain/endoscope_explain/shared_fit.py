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

from endoscope_core.effects import CATALOGUE, Stage
from endoscope_core.effects.slots import NOMINAL_KEYS, START_FRICTION
from endoscope_explain.fit import STEP, Fit, JointModel, bounded_step
from endoscope_explain.free_parameters import LEAD, FreeParameter

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SPREAD = 0.1
"""Scatter of a pooled coordinate from one shape of the tube to another: ten per cent."""
FIRST_SPREAD = 0.5
"""Scatter that is allowed at first, so that a recording finds its way to the others."""

OF_A_DEVICE = frozenset({Stage.ACTUATOR, Stage.SENSING})
_OF_A_DEVICE = frozenset(
    {LEAD, *(NOMINAL_KEYS.index(key) for key in ('motor_bandwidth', 'motor_damping_ratio'))}
) | {
    place
    for definition in CATALOGUE.values()
    if definition.stage in OF_A_DEVICE
    for place in definition.places
}
_OF_A_SHAPE = frozenset(
    {
        START_FRICTION,
        *(NOMINAL_KEYS.index(key) for key in ('capstan_exponent', 'presliding_distance')),
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
    derivatives = _derivatives(models, layout, whole, STEP)
    fits = []
    for model, columns, (residuals, jacobian) in zip(
        models, layout.columns, derivatives, strict=True
    ):
        theta = whole[columns]
        prior = model.prior(theta)
        cost = 0.5 * float(residuals @ residuals + prior @ prior)
        fits.append(Fit(model, theta, residuals, jacobian, cost))
    return fits


def with_common_numbers(fits: Sequence[Fit]) -> list[Array]:
    """Coordinates of each recording with pooled ones at the median of all recordings."""
    layout = _layout([f.model for f in fits])
    whole = np.zeros(len(layout.low))
    for found, columns in zip(fits, layout.columns, strict=True):
        whole[columns] = found.theta
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
    layout = _layout([f.model for f in fits])
    whole = np.zeros(len(layout.low))
    for found, columns in zip(fits, layout.columns, strict=True):
        whole[columns] = found.theta
    mean = whole.copy()
    for pool in layout.pools:
        mean[pool] = np.mean(whole[pool])
    pooled = np.isin(np.arange(len(whole)), np.concatenate([*layout.pools, np.zeros(0)]))
    alone = []
    for found, columns in zip(fits, layout.columns, strict=True):
        model = found.model
        base, _ = model.packed(found.theta)
        kept = [k for k, item in enumerate(model.free) if item.index not in _HELD]
        free = tuple(
            _drawn_to(model.free[k], float(mean[columns[k]]))
            if pooled[columns[k]]
            else model.free[k]
            for k in kept
        )
        told = replace(model, base=base, free=free)
        theta = found.theta[kept]
        prior = told.prior(theta)
        cost = 0.5 * float(found.residuals @ found.residuals + prior @ prior)
        alone.append(Fit(told, theta, found.residuals, found.jacobian[:, kept], cost))
    return alone


_HELD = _OF_A_DEVICE - {LEAD}


def _drawn_to(item: FreeParameter, mean: float) -> FreeParameter:
    """The parameter with the prior that it has, times that of the other recordings."""
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
            if item.index in _OF_A_DEVICE:
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

    def cost_of(residuals: Sequence[Array], at: Array) -> float:
        squares = sum(float(r @ r) for r in residuals)
        for model, columns in zip(models, layout.columns, strict=True):
            squares += float(np.sum(model.prior(at[columns]) ** 2))
        for pool in layout.pools:
            squares += float(np.sum((at[pool] - np.mean(at[pool])) ** 2)) / spread**2
        return 0.5 * squares

    cost = cost_of(_residuals(models, layout, whole), whole)
    damping, steps = 1e-4, effort.steps
    for _ in range(effort.iterations):
        derivatives = _derivatives(models, layout, whole, steps[0])
        normal, gradient = _normal_equations(models, layout, whole, derivatives, spread)
        scale = np.maximum(np.diag(normal), 1e-9)
        before = cost
        damping = min(damping, 1e-2)
        for _ in range(7):
            step = bounded_step(
                normal + damping * np.diag(scale), gradient, whole, layout.low, layout.high
            )
            trial = whole + step
            trial_cost = cost_of(_residuals(models, layout, trial), trial)
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


def _residuals(models: Sequence[JointModel], layout: _Layout, whole: Array) -> list[Array]:
    return [m.residuals(whole[c]) for m, c in zip(models, layout.columns, strict=True)]


def _derivatives(
    models: Sequence[JointModel], layout: _Layout, whole: Array, step: float
) -> list[tuple[Array, Array]]:
    """Residuals and their central difference quotients, recording by recording."""
    found = []
    for model, columns in zip(models, layout.columns, strict=True):
        theta = whole[columns]
        low, high = model.bounds()
        at = model.residuals(theta)
        result = np.empty((len(at), len(theta)))
        for k, item in enumerate(model.free):
            reach = max(step, model.step) * (1.0 if item.logarithmic else 2.0)
            below, above = theta.copy(), theta.copy()
            below[k] = max(theta[k] - reach, low[k])
            above[k] = min(theta[k] + reach, high[k])
            moved = model.residuals(above) - model.residuals(below)
            result[:, k] = moved / (above[k] - below[k])
        found.append((at, result))
    return found


def _normal_equations(
    models: Sequence[JointModel],
    layout: _Layout,
    whole: Array,
    derivatives: Sequence[tuple[Array, Array]],
    spread: float,
) -> tuple[Array, Array]:
    normal = np.zeros((len(whole), len(whole)))
    gradient = np.zeros(len(whole))
    for model, columns, (residuals, jacobian) in zip(
        models, layout.columns, derivatives, strict=True
    ):
        weight = model.prior_weight()
        normal[np.ix_(columns, columns)] += jacobian.T @ jacobian + np.diag(weight**2)
        gradient[columns] += jacobian.T @ residuals + weight * model.prior(whole[columns])
    for pool in layout.pools:
        together = (np.eye(len(pool)) - 1.0 / len(pool)) / spread**2
        normal[np.ix_(pool, pool)] += together
        gradient[pool] += together @ whole[pool]
    return normal, gradient
