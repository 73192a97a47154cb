"""Search over compositions of effects on one recording: all singles, then a beam that adds more."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.fit.free_parameters import BAND, nominal_parameters
from endoscope_explain.fit.model import Fit, JointModel, fit, jacobian
from endoscope_explain.fit.score import FLOOR_PER_PARAMETER, score
from endoscope_explain.fit.whiteness import is_noise
from endoscope_explain.observation import JointObservation
from endoscope_explain.parallel import parallel_map
from endoscope_explain.rank import Look, look, polish
from endoscope_explain.screen import Promise, promises, unexplained

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

LOOKED_AT = 14
"""Effects that get a cheap fit beside another one, of all that were screened. Alone, every effect
gets one: a plant refitted far from its description promises little of the right one."""
LOOKED_AT_TWICE = 4
"""Effects of these that get one from their second best start as well."""
LEAST_GAIN = 5.0
"""Predicted fall of the half deviance below which an effect is not looked at."""
FINISHED = 20
"""Further steps of a nominal refit that may be on its way to noise."""
WORTH_POLISHING = 5.0
"""A look is worth a full fit while its cost is below this multiple of the best full fit's."""
NOISE_ALONE = 1.15
"""Mean squared residual in noise units below which no further effect is looked for."""


@dataclass(frozen=True)
class Composition:
    """A fitted joint with some effects.

    Attributes
    ----------
    effects : tuple of str
        In the order in which they were added.
    fit : Fit
    score : float
        See `score.score`.
    """

    effects: tuple[str, ...]
    fit: Fit
    score: float

    def floor(self) -> float:
        """Return the score that this composition would have if nothing but noise were left."""
        return FLOOR_PER_PARAMETER * len(self.fit.theta)

    def above_noise(self) -> float:
        """Return by how much the score is above `floor`."""
        return self.score - self.floor()


Parent = tuple[Composition, tuple[Fit, ...]]


def searchable_effects() -> tuple[str, ...]:
    """Effects of the catalogue that a simulation can show, in the order of the chain."""
    return tuple(effect.id for effect in CATALOGUE.values() if not effect.traits.audited)


def nominal_model(
    observation: JointObservation,
    base: Array,
    flags: Flags,
    band: float = BAND,
) -> JointModel:
    """Return the plant as described, its nominal parameters free within a band."""
    return JointModel(observation, base, flags, nominal_parameters(base, band))


def nominal_anchors(
    observation: JointObservation,
    base: Array,
    flags: Flags,
    band: float = BAND,
) -> tuple[Fit, Fit]:
    """The nominal plant refitted, and as described, each with its derivative.

    Parameters
    ----------
    observation : JointObservation
    base : array (parameters,), flags : array (flags,)
        Packed plant as described, with what effects it has.
    band : float
        Relative deviation of a healthy rig from its description.

    Returns
    -------
    refitted, described : Fit
    """
    model = nominal_model(observation, base, flags, band)
    theta = np.array([item.mean for item in model.free])
    residuals = model.residuals(theta)
    described = Fit(
        model,
        theta,
        residuals,
        jacobian(model, theta, residuals),
        0.5 * float(residuals @ residuals),
    )
    refitted = fit(model, theta, known_jacobian=described.jacobian)
    if is_noise(refitted):
        return refitted, described
    # On to the end only where no physics is missing: it would bend the parameters ever further.
    finished = fit(model, refitted.theta, iterations=FINISHED, known_jacobian=refitted.jacobian)
    return finished if is_noise(finished) else refitted, described


def grow(
    parents: Sequence[Parent], effect_ids: Sequence[str], jobs: int, most: int
) -> list[Composition]:
    """Compositions with one more effect than their parents, the most promising ones refitted.

    Parameters
    ----------
    parents : sequence of (Composition, anchors)
        Anchors are fits of the parent's own model; see `rank.look`.
    effect_ids : sequence of str
    jobs : int
        Tasks side by side.
    most : int
        How many to fit fully, at most, over all parents.

    Returns
    -------
    list of Composition
        Best first.
    """
    screened = _screened(parents, effect_ids, jobs)
    looks = _looks(parents, screened, jobs)
    if screened:
        # Where the misfit is rugged, a look from a good start may end far away from it.
        index, promise = max(screened, key=lambda s: s[1].gain)
        promised = {*parents[index][0].effects, promise.effect_id}
        looks.sort(key=lambda item: set(item.effects) != promised)
    grown: list[Composition] = []
    batch = max(jobs, 2)
    while looks and len(grown) < most:
        best = min((c.fit.cost for c in grown), default=float('inf'))
        now = [item for item in looks[:batch] if item.cost < WORTH_POLISHING * best]
        looks = looks[batch:]
        if not now:
            break
        grown += polished(now, jobs)
    return sorted(grown, key=lambda c: c.score)


def _screened(
    parents: Sequence[Parent], effect_ids: Sequence[str], jobs: int
) -> list[tuple[int, Promise]]:
    tasks = [
        (index, effect_id)
        for index, (parent, _) in enumerate(parents)
        for effect_id in effect_ids
        if effect_id not in parent.effects
    ]

    left = [unexplained(anchors[0]) for _, anchors in parents]

    def screened(task: tuple[int, str]) -> list[Promise]:
        return promises(left[task[0]], task[1])

    found = parallel_map(screened, tasks, jobs)
    chosen = []
    for index in range(len(parents)):
        own = sorted(
            (p for (i, _), p in zip(tasks, found, strict=True) if i == index and p),
            key=lambda p: -p[0].gain,
        )
        own = own[:LOOKED_AT] if parents[index][0].effects else own
        chosen += [(index, p[0]) for p in own if p[0].gain > LEAST_GAIN]
        chosen += [
            (index, p[1]) for p in own[:LOOKED_AT_TWICE] if len(p) > 1 and p[1].gain > LEAST_GAIN
        ]
    return chosen


def _looks(
    parents: Sequence[Parent], chosen: Sequence[tuple[int, Promise]], jobs: int
) -> list[Look]:
    def looked(task: tuple[int, Promise]) -> Look:
        parent, anchors = parents[task[0]]
        return look(anchors, parent.effects, task[1])

    best: dict[frozenset[str], Look] = {}
    for item in parallel_map(looked, chosen, jobs):
        key = frozenset(item.effects)
        if key not in best or item.cost < best[key].cost:
            best[key] = item
    return sorted(best.values(), key=lambda item: item.cost)


def polished(looks: Sequence[Look], jobs: int) -> list[Composition]:
    """Full fits of what was looked at, in the same order, with `jobs` tasks side by side."""
    fits = parallel_map(polish, looks, jobs)
    return [Composition(item.effects, f, score(f)) for item, f in zip(looks, fits, strict=True)]
