"""Search over compositions of effects on one recording: all singles, then a beam that adds more."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.effects import CATALOGUE, Stage
from endoscope_explain.evaluate import packed_joint
from endoscope_explain.fit import Fit, JointModel, fit, jacobian
from endoscope_explain.free_parameters import nominal_parameters
from endoscope_explain.observation import JointObservation
from endoscope_explain.parallel import parallel_map
from endoscope_explain.rank import Look, look, polish
from endoscope_explain.score import score
from endoscope_explain.screen import Promise, promises, with_effect

Array = NDArray[np.float64]

AUDITED = frozenset({'recording_gap', 'tracker_outliers'})
"""Effects that lose or replace single samples: the audit finds them, no simulation can."""
STARTS_PER_EFFECT = 2
POLISHED = 8
BEAM = 2
PAIRS_LOOKED_AT = 10
PAIRS_POLISHED = 4


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


def searchable_effects() -> tuple[str, ...]:
    """Effects of the catalogue that a simulation can show, in the order of the chain."""
    return tuple(effect_id for effect_id in CATALOGUE if effect_id not in AUDITED)


def nominal_anchors(observation: JointObservation, base: Array, flags: Array) -> tuple[Fit, Fit]:
    """The nominal plant refitted, and as described, each with its derivative.

    Parameters
    ----------
    observation : JointObservation
    base : array (parameters,), flags : array (flags,)
        Packed plant as described, with what effects it has.

    Returns
    -------
    refitted, described : Fit
    """
    model = JointModel(observation, base, flags, nominal_parameters(base))
    theta = np.array([
        item.mean if item.logarithmic else item.coordinate(1.0) for item in model.free])
    residuals = model.residuals(theta)
    described = Fit(model, theta, residuals, jacobian(model, theta, residuals),
                    0.5 * float(residuals @ residuals))
    return fit(model, theta, known_jacobian=described.jacobian), described


def grow(
    parents: Sequence[tuple[Composition, tuple[Fit, ...]]],
    effect_ids: Sequence[str],
    jobs: int,
    looked_at: int | None,
    polished: int,
) -> list[Composition]:
    """Compositions with one more effect than their parents, the most promising ones refitted.

    Parameters
    ----------
    parents : sequence of (Composition, anchors)
        Anchors are fits of the parent's own model; see `rank.look`.
    effect_ids : sequence of str
    jobs : int
    looked_at : int or None
        How many effects to look at for each parent; all if None.
    polished : int
        How many to fit fully, over all parents.

    Returns
    -------
    list of Composition
        Best first.
    """
    def screened(index_and_effect: tuple[int, str]) -> list[Promise]:
        index, effect_id = index_and_effect
        return promises(parents[index][1][0], [effect_id])

    tasks = [(index, effect_id) for index, (parent, _) in enumerate(parents)
             for effect_id in effect_ids if effect_id not in parent.effects]
    found = parallel_map(screened, tasks, jobs)
    chosen: list[tuple[int, Promise]] = []
    for index in range(len(parents)):
        own = [p for (i, _), p in zip(tasks, found, strict=True) if i == index]
        own.sort(key=lambda p: -p[0].gain)
        chosen += [(index, q) for p in own[:looked_at] for q in p[:STARTS_PER_EFFECT]]

    def looked(index_and_promise: tuple[int, Promise]) -> tuple[Array, float]:
        index, promise = index_and_promise
        parent, anchors = parents[index]
        item = look(anchors, parent.effects, promise)
        return item.theta, item.cost

    best: dict[tuple[int, str], Look] = {}
    for (index, promise), (theta, cost) in zip(
            chosen, parallel_map(looked, chosen, jobs), strict=True):
        parent, anchors = parents[index]
        key = (index, promise.effect_id)
        if key not in best or cost < best[key].cost:
            model = with_effect(anchors[0].model, promise.effect_id, promise.start)
            best[key] = Look((*parent.effects, promise.effect_id), model, theta, cost)
    unique: dict[frozenset[str], Look] = {}
    for item in sorted(best.values(), key=lambda item: item.cost):
        unique.setdefault(frozenset(item.effects), item)
    kept = list(unique.values())[:polished]

    def polished_fit(index: int) -> tuple[Array, Array, Array, float]:
        done = polish(kept[index])
        return done.theta, done.residuals, done.jacobian, done.cost

    fits = [Fit(item.model, *numbers) for item, numbers in zip(
        kept, parallel_map(polished_fit, range(len(kept)), jobs), strict=True)]
    grown = [Composition(item.effects, f, score(f))
             for item, f in zip(kept, fits, strict=True)]
    return sorted(grown, key=lambda c: c.score)
