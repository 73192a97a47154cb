"""Explain a joint by physics that was chosen elsewhere."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.compose import Composition
from endoscope_explain.fit.free_parameters import FreeParameter
from endoscope_explain.fit.model import Fit, JointModel, fit, without_effect
from endoscope_explain.fit.score import score
from endoscope_explain.parallel import parallel_map
from endoscope_explain.search import JointSearch

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SETTLED = 1e-4
SETTLING_STEPS = 20


@dataclass(frozen=True)
class GivenPhysics:
    """A fitted joint without its recording.

    Attributes
    ----------
    effects : tuple of str
        In the order in which they were added.
    base : array (parameters,)
    flags : array (flags,) of bool
    free : tuple of FreeParameter
        As in `JointModel`.
    theta : array (n,)
    """

    effects: tuple[str, ...]
    base: Array
    flags: Flags
    free: tuple[FreeParameter, ...]
    theta: Array


GivenJoints = Mapping[str, GivenPhysics]
"""By joint."""


def without_recording(effects: tuple[str, ...], found: Fit) -> GivenPhysics:
    """The physics of a fit."""
    model = found.model
    return GivenPhysics(effects, model.base, model.flags, model.free, found.theta)


def settled(model: JointModel, theta: Array) -> Fit:
    """Fit until nothing moves any more."""
    return fit(model, theta, iterations=SETTLING_STEPS, tolerance=SETTLED)


def explained_by(anchors: tuple[Fit, Fit], given: GivenPhysics, jobs: int) -> JointSearch:
    """Fit given physics to a joint, and see what each of its effects is needed for.

    Parameters
    ----------
    anchors : (Fit, Fit)
        Nominal plant refitted, and as described.
    given : GivenPhysics
    jobs : int
        Tasks side by side.

    Returns
    -------
    JointSearch
        One level: all effects together, then without each of them.
    """
    nominal = Composition((), anchors[0], score(anchors[0]))
    if not given.effects:
        return JointSearch(nominal, ())
    model = JointModel(anchors[0].model.observation, given.base, given.flags, given.free)
    found = settled(model, given.theta)
    whole = Composition(given.effects, found, score(found))
    lesser = [without_effect(found, effect_id) for effect_id in given.effects]
    fits = parallel_map(lambda less: fit(*less), lesser, jobs)
    level = [
        Composition(tuple(e for e in given.effects if e != effect_id), f, score(f))
        for effect_id, f in zip(given.effects, fits, strict=True)
    ]
    return JointSearch(nominal, ((whole, *sorted(level, key=lambda c: c.score)),))
