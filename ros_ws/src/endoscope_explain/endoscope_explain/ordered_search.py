"""Explain a joint by given effects, one added after the other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.effects import CATALOGUE
from endoscope_explain.agreement import GivenEffect, in_line
from endoscope_explain.compose import Composition
from endoscope_explain.fit import Fit, JointModel, fit
from endoscope_explain.parallel_fits import parallel_fits
from endoscope_explain.rank import Look, look, polish
from endoscope_explain.score import score
from endoscope_explain.screen import promises, unexplained, with_effect
from endoscope_explain.search import JointSearch

Array = NDArray[np.float64]

STARTS = 2
"""Starting points of an effect from which it is fitted."""
SETTLED = 1e-4
SETTLING_STEPS = 20


@dataclass(frozen=True)
class Glance:
    """A cheap fit without the recording that it was made on.

    Attributes
    ----------
    effect_id : str
        The effect that was added.
    start : dict of str to float
        Parameters from which it was fitted.
    theta : array (n,)
    cost : float
    """

    effect_id: str
    start: dict[str, float]
    theta: Array
    cost: float

    def look(self, anchors: tuple[Fit, ...], effects: tuple[str, ...]) -> Look:
        """The look at the anchors, with these effects, that this was."""
        model = with_effect(anchors[0].model, self.effect_id, self.start)
        return Look((*effects, self.effect_id), model, self.theta, self.cost)


def glance(anchors: tuple[Fit, ...], effects: tuple[str, ...], effect_id: str) -> Glance | None:
    """Cheap fit of one more effect from its best starting points; None where it has none.

    Parameters
    ----------
    anchors : tuple of Fit
        See `rank.look`.
    effects : tuple of str
        Effects that the anchors have.
    effect_id : str
        The one to add.
    """
    found = []
    for promise in promises(unexplained(anchors[0]), effect_id)[:STARTS]:
        item = look(anchors, effects, promise)
        found.append(Glance(effect_id, promise.start, item.theta, item.cost))
    return min(found, key=lambda item: item.cost, default=None)


def settled(model: JointModel, theta: Array) -> Fit:
    """Fit until nothing moves any more."""
    return fit(model, theta, iterations=SETTLING_STEPS, tolerance=SETTLED)


def separate_fit(item: Look) -> Fit:
    """Fit of one recording by itself, from a look."""
    begun = polish(item)
    return settled(begun.model, begun.theta)


def in_order(anchors: tuple[Fit, Fit], order: Sequence[GivenEffect], jobs: int) -> JointSearch:
    """Add effects in a given order, and see what each of them is needed for.

    Parameters
    ----------
    anchors : (Fit, Fit)
        Nominal plant refitted, and as described.
    order : sequence of GivenEffect
        The most important one first.
    jobs : int
        Processes side by side.

    Returns
    -------
    JointSearch
        One level: all effects together, then without each of them.
    """
    nominal = Composition((), anchors[0], score(anchors[0]))
    parent: tuple[Fit, ...] = anchors
    effects: tuple[str, ...] = ()
    for given in order:
        item = glance(parent, effects, given.id)
        if item is not None:
            fitted = separate_fit(item.look(parent, effects))
            parent = (settled(*in_line(fitted, given)) if given.agreed else fitted,)
            effects = (*effects, given.id)
    if not effects:
        return JointSearch(nominal, ())
    whole = Composition(effects, parent[0], score(parent[0]))
    lesser = [_begun_without(whole, effect_id) for effect_id in effects]
    fits = parallel_fits(lambda i: fit(*lesser[i]), [model for model, _ in lesser], jobs)
    level = [
        Composition(tuple(e for e in effects if e != effect_id), f, score(f))
        for effect_id, f in zip(effects, fits, strict=True)
    ]
    return JointSearch(nominal, ((whole, *sorted(level, key=lambda c: c.score)),))


def _begun_without(whole: Composition, effect_id: str) -> tuple[JointModel, Array]:
    """Model and first coordinates of a composition that has lost one effect."""
    definition = CATALOGUE[effect_id]
    places = range(
        definition.first_parameter, definition.first_parameter + len(definition.parameters)
    )
    model = whole.fit.model
    flags = model.flags.copy()
    flags[definition.flag] = False
    kept = [i for i, item in enumerate(model.free) if item.index not in places]
    free = tuple(model.free[i] for i in kept)
    return replace(model, flags=flags, free=free), whole.fit.theta[kept]
