"""One fit of several recordings of a rig whose tube is bent differently in each.

What a device is like, and its radii, is one number for all recordings. Wires and joint hardly
change from one shape of the tube to the next: their numbers scatter a little around a common mean,
which the data of all recordings determine (partial pooling: Gelman, Hill, Data Analysis Using
Regression and Multilevel/Hierarchical Models, Cambridge University Press 2007, ch. 12). Only what a
bent sheath does to a wire is each recording's own.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import NUMBERS, Keeper
from endoscope_core.physics.effect import Stage
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.layout import (
    FRICTION_PROFILE,
    NOMINAL_KEYS,
    PROFILE_TERMS,
)
from endoscope_explain.fit.evidence import weights
from endoscope_explain.fit.free_parameters import COEFFICIENT, LEAD, FreeParameter
from endoscope_explain.fit.model import Fit, JointModel, central_jacobian, fit
from endoscope_explain.fit.solver import STEP, Effort, Renewal, minimise
from endoscope_explain.observe.revisits import folds

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SPREAD = 0.1
"""Scatter of a pooled coordinate from one shape of the tube to another: ten per cent."""
FIRST_SPREAD = 0.5
"""Scatter that is allowed at first, so that a recording finds its way to the others."""


def _kept_by(keeper: Keeper) -> set[int]:
    return {i for i, key in enumerate(NOMINAL_KEYS) if NUMBERS[key].keeper is keeper}


_OF_A_DEVICE = frozenset(_kept_by(Keeper.DEVICE)) | {
    place
    for definition in CATALOGUE.values()
    if definition.stage in (Stage.ACTUATOR, Stage.SENSING)
    for place in definition.places
}
_OF_A_SHAPE = frozenset(
    {
        *_kept_by(Keeper.SHAPE),
        *range(FRICTION_PROFILE, FRICTION_PROFILE + PROFILE_TERMS),
        *(p for e in CATALOGUE.values() if e.traits.of_shape for p in e.places),
    }
)


ROUGH = Effort(12, 1e-3, (10.0 * STEP,), Renewal.ALWAYS)
ON_THE_WAY = Effort(20, 1e-3, (STEP, 10.0 * STEP), Renewal.ALWAYS)
FORETOLD = 12, 1e-3
THOROUGH = Effort(30, 1e-4, (STEP, 10.0 * STEP, 60.0 * STEP), Renewal.ALWAYS)


@dataclass(frozen=True)
class _Layout:
    """Where the coordinates of all recordings lie in one vector."""

    # Of each recording, the place of each of its free parameters; tied ones share theirs.
    columns: tuple[Indices, ...]
    pools: tuple[Indices, ...]  # places of parameters that scatter around a common mean
    # (N,), bounds.
    low: Array
    high: Array
    scale: Array  # (N,), of what a pooled coordinate scatters by, in `SPREAD`


def fit_together(
    models: Sequence[JointModel],
    starts: Sequence[Array],
    *,
    rough: bool = False,
) -> list[Fit]:
    """Fit all recordings of a rig together; the cost of each is its own."""
    # Coordinates of devices start from their median. To tell which effect is the better one, a
    # rough fit is enough.
    layout = _layout(models)
    whole = np.zeros(len(layout.low))
    for place in range(len(whole)):
        found = [s[c == place] for s, c in zip(starts, layout.columns, strict=True)]
        whole[place] = np.median(np.concatenate(found))
    whole = np.clip(whole, layout.low, layout.high)
    if rough:
        return _together(models, layout, whole, SPREAD, ROUGH)
    # Near the end channels are weighted by what is left, as the evidence does.
    whole = _whole(_together(models, layout, whole, FIRST_SPREAD, ON_THE_WAY), layout)
    return _together(models, layout, whole, SPREAD, THOROUGH)


def with_common_numbers(fits: Sequence[Fit]) -> list[Array]:
    """Coordinates of each recording with pooled ones at the median of all recordings."""
    layout, whole = _laid_out(fits)
    for pool in layout.pools:
        whole[pool] = np.median(whole[pool])
    return [whole[columns] for columns in layout.columns]


def deviations(fits: Sequence[Fit]) -> list[Array]:
    """Standard deviations (n,) of the coordinates of fits of `fit_together`, by white noise."""
    layout, whole = _laid_out(fits)
    weight = [weights(f.model.observation, f.residuals) for f in fits]
    together = _Together([f.model for f in fits], layout, SPREAD, weight)
    left, slopes = [f.residuals for f in fits], [f.jacobian for f in fits]
    normal, _ = together.normal_equations(whole, left, slopes)
    ridge = 1e-9 * np.diag(np.maximum(np.diag(normal), 1e-12))
    deviation = np.sqrt(np.diag(np.linalg.inv(normal + ridge)))
    return [deviation[columns] for columns in layout.columns]


def judged_alone(fits: Sequence[Fit]) -> list[Fit]:
    """Each recording's fit of `fit_together` as it can be continued without the others."""
    # Devices are held as found; a pooled parameter has the others' mean and scatter for a prior.
    layout, whole = _laid_out(fits)
    means = {int(place): float(np.mean(whole[pool])) for pool in layout.pools for place in pool}
    alone = []
    for found, columns in zip(fits, layout.columns, strict=True):
        told, kept = _alone(found.model, found.theta, columns, means)
        theta = found.theta[kept]
        cost = told.cost(found.residuals, theta)
        alone.append(
            replace(found, model=told, theta=theta, jacobian=found.jacobian[:, kept], cost=cost)
        )
    return alone


def foretold(fits: Sequence[Fit]) -> list[Array]:
    """Residuals (size,) of each recording by what the others say of the rig.

    Devices have the numbers that the others give, pooled ones the others' mean for a prior. What
    may scatter is refitted, to other blocks than those that are judged.
    """
    # The others' optimum is a Gauss-Newton step from that of all: an infinitesimal jackknife
    # (Giordano et al., AISTATS 2019).
    layout, whole = _laid_out(fits)
    weight = [weights(f.model.observation, f.residuals) for f in fits]
    found = []
    for left_out, (own, columns) in enumerate(zip(fits, layout.columns, strict=True)):
        others = [n for n in range(len(fits)) if n != left_out]
        kept = np.unique(np.concatenate([layout.columns[n] for n in others]))
        pools = tuple(np.intersect1d(pool, kept) for pool in layout.pools)
        theirs = _Together(
            [fits[n].model for n in others],
            replace(layout, columns=tuple(layout.columns[n] for n in others), pools=pools),
            SPREAD,
            [weight[n] for n in others],
        )
        normal, gradient = theirs.normal_equations(
            whole, [fits[n].residuals for n in others], [fits[n].jacobian for n in others]
        )
        normal = normal[np.ix_(kept, kept)]
        normal += 1e-9 * np.diag(np.maximum(np.diag(normal), 1e-12))
        moved = whole.copy()
        moved[kept] -= np.linalg.solve(normal, gradient[kept])
        moved = np.clip(moved, layout.low, layout.high)
        means = {
            int(place): float(np.mean(moved[theirs_of]))
            for pool, theirs_of in zip(layout.pools, pools, strict=True)
            for place in pool
        }
        told, free = _alone(own.model, moved[columns], columns, means)
        theta, residuals = moved[columns][free], own.residuals.copy()
        for fitted, judged in folds(own.model.observation.times):
            again = fit(told, theta, fitted * weight[left_out], *FORETOLD)
            residuals[judged] = again.residuals[judged]
            theta = again.theta
        found.append(residuals)
    return found


def _alone(
    model: JointModel, theta: Array, columns: Indices, means: Mapping[int, float]
) -> tuple[JointModel, list[int]]:
    """A recording's model with devices held and pooled numbers drawn to means; what stays free."""
    base, _ = model.packed(theta)
    kept = [k for k, item in enumerate(model.free) if item.index not in _OF_A_DEVICE]
    free = tuple(_drawn_to(model.free[k], means.get(int(columns[k]))) for k in kept)
    return replace(model, base=base, free=free), kept


def _laid_out(fits: Sequence[Fit]) -> tuple[_Layout, Array]:
    layout = _layout([f.model for f in fits])
    return layout, _whole(fits, layout)


def _whole(fits: Sequence[Fit], layout: _Layout) -> Array:
    whole = np.zeros(len(layout.low))
    for found, columns in zip(fits, layout.columns, strict=True):
        whole[columns] = found.theta
    return whole


def _drawn_to(item: FreeParameter, mean: float | None) -> FreeParameter:
    """The parameter with the prior that it has, times that of the other recordings if any."""
    if mean is None:
        return item
    own = 0.0 if math.isinf(item.spread) else item.spread**-2
    others = (SPREAD * _scale(item)) ** -2
    return replace(
        item,
        mean=(own * item.mean + others * mean) / (own + others),
        spread=(own + others) ** -0.5,
    )


def _scale(item: FreeParameter) -> float:
    """What a pooled coordinate scatters by, in `SPREAD`: a coefficient by a share of its prior."""
    return item.spread if item.index == COEFFICIENT else 1.0


def _layout(models: Sequence[JointModel]) -> _Layout:
    tied: dict[int, int] = {}
    pools: dict[tuple[int, str], list[int]] = {}
    columns: list[Indices] = []
    low: list[float] = []
    high: list[float] = []
    scale: list[float] = []
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
            scale.append(_scale(item))
            own.append(place)
            if item.index == LEAD or item.index in _OF_A_DEVICE:
                tied[item.index] = place
            elif item.index not in _OF_A_SHAPE:
                # Coefficients of functions have one index, and a name each.
                pools.setdefault((item.index, item.name), []).append(place)
        columns.append(np.array(own, dtype=np.int64))
    return _Layout(
        tuple(columns),
        tuple(np.array(p, dtype=np.int64) for p in pools.values() if len(p) > 1),
        np.array(low),
        np.array(high),
        np.array(scale),
    )


@dataclass(frozen=True)
class _Together:
    """All recordings as one objective; residuals and derivatives in a list, one each."""

    models: Sequence[JointModel]
    layout: _Layout
    spread: float
    weights: Sequence[Array]

    def bounds(self) -> tuple[Array, Array]:
        return self.layout.low, self.layout.high

    def evaluate(self, theta: Array) -> tuple[list[Array], float]:
        residuals, cost = [], 0.0
        for model, columns, weight in zip(
            self.models, self.layout.columns, self.weights, strict=True
        ):
            residuals.append(model.residuals(theta[columns]))
            cost += model.cost(weight * residuals[-1], theta[columns])
        for pool in self.layout.pools:
            away = (theta[pool] - np.mean(theta[pool])) / (self.spread * self.layout.scale[pool])
            cost += 0.5 * float(np.sum(away**2))
        return residuals, cost

    def derivative(self, theta: Array, residuals: list[Array], stride: float) -> list[Array]:
        return [
            central_jacobian(model, theta[columns], stride)
            for model, columns in zip(self.models, self.layout.columns, strict=True)
        ]

    def normal_equations(
        self, theta: Array, residuals: list[Array], derivative: list[Array]
    ) -> tuple[Array, Array]:
        normal = np.zeros((len(theta), len(theta)))
        gradient = np.zeros(len(theta))
        for model, columns, weight, left, slope in zip(
            self.models, self.layout.columns, self.weights, residuals, derivative, strict=True
        ):
            own, weighted = model.prior_weight(), weight[:, None] * slope
            normal[np.ix_(columns, columns)] += weighted.T @ weighted + np.diag(own**2)
            gradient[columns] += weighted.T @ (weight * left) + own * model.prior(theta[columns])
        for pool in self.layout.pools:
            scatter = self.spread * self.layout.scale[pool[0]]
            together = (np.eye(len(pool)) - 1.0 / len(pool)) / scatter**2
            normal[np.ix_(pool, pool)] += together
            gradient[pool] += together @ theta[pool]
        return normal, gradient

    def updated(
        self, derivative: list[Array], step: Array, before: list[Array], after: list[Array]
    ) -> list[Array]:
        raise NotImplementedError('a pooled fit renews its derivatives')


def _together(
    models: Sequence[JointModel], layout: _Layout, start: Array, spread: float, effort: Effort
) -> list[Fit]:
    begun = [m.residuals(start[c]) for m, c in zip(models, layout.columns, strict=True)]
    weight = [weights(m.observation, r) for m, r in zip(models, begun, strict=True)]
    found = minimise(_Together(models, layout, spread, weight), start, effort)
    fits = []
    for model, columns, own, residuals, derivative in zip(
        models, layout.columns, weight, found.residuals, found.derivative, strict=True
    ):
        theta = found.theta[columns]
        cost = model.cost(own * residuals, theta)
        fits.append(
            Fit(
                model,
                theta,
                residuals,
                derivative,
                cost,
                steps=found.steps,
                ended=found.ended,
            )
        )
    return fits
