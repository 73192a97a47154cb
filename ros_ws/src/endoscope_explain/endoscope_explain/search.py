"""Which effects a joint's recording shows: nominal refit, singles, and a beam of more."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.effects import CATALOGUE
from endoscope_core.effects.slots import NOMINAL_KEYS
from endoscope_core.plant.kernel import OUT_JOINT
from endoscope_explain.compose import (
    Composition,
    Parent,
    grow,
    nominal_anchors,
    nominal_model,
    searchable_effects,
)
from endoscope_explain.evaluate import simulate_joint
from endoscope_explain.fit import Fit, JointModel, fit
from endoscope_explain.free_parameters import BAND
from endoscope_explain.observation import JointObservation, couple
from endoscope_explain.parallel import parallel_map
from endoscope_explain.score import score
from endoscope_explain.whiteness import is_noise

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SINGLES_POLISHED = 6
PAIRS_POLISHED = 3
REPLACED_POLISHED = 2
BEAM = 3
RIVALS = 0.5
"""Share of the best composition's gain from which on a lesser one is worth adding to as well."""
HOPELESS = 0.03
"""Where no single effect removes this share of the excess misfit, no second one is tried."""


@dataclass(frozen=True)
class JointSearch:
    """What was tried on one joint.

    Attributes
    ----------
    nominal : Composition
        No effect added.
    levels : tuple of tuple of Composition
        Compositions of one, two, ... effects, each best first.
    """

    nominal: Composition
    levels: tuple[tuple[Composition, ...], ...]

    def tried(self) -> list[Composition]:
        """Return all compositions, the nominal one first."""
        return [self.nominal, *(c for level in self.levels for c in level)]


def all_anchors(
    observations: tuple[JointObservation, ...],
    packed: dict[str, tuple[Array, Flags]],
    jobs: int,
    band: float = BAND,
) -> list[tuple[Fit, Fit]]:
    """Refit the nominal plant of every joint, and let the joints see each other's angle."""

    def numbers(index: int) -> tuple[tuple[Array, Array, Array, float], ...]:
        observation = observations[index]
        fits = nominal_anchors(observation, *packed[observation.joint], band)
        return tuple((f.theta, f.residuals, f.jacobian, f.cost) for f in fits)

    anchors = []
    for observation, found in zip(
        observations, parallel_map(numbers, range(len(observations)), jobs), strict=True
    ):
        model = nominal_model(observation, *packed[observation.joint], band)
        anchors.append((Fit(model, *found[0]), Fit(model, *found[1])))
    angles = []
    for observation, (fitted, _) in zip(observations, anchors, strict=True):
        parameters, _ = fitted.model.packed(fitted.theta)
        angles.append(simulate_joint(observation, parameters, fitted.model.flags)[:, OUT_JOINT])
    couple(observations, tuple(angles))
    return anchors


def search(anchors: tuple[Fit, Fit], jobs: int, depth: int = 2) -> JointSearch:
    """Search the compositions of effects on one joint.

    Parameters
    ----------
    anchors : (Fit, Fit)
        Nominal plant refitted, and as described.
    jobs : int
        Processes side by side.
    depth : int
        Largest number of effects.

    Returns
    -------
    JointSearch
    """
    nominal = Composition((), anchors[0], score(anchors[0]))
    levels: list[tuple[Composition, ...]] = []
    if is_noise(nominal.fit):
        return JointSearch(nominal, ())
    parents: list[Parent] = [(nominal, anchors)]
    for level in range(depth):
        polished = SINGLES_POLISHED if level == 0 else PAIRS_POLISHED
        grown = grow(parents, searchable_effects(), jobs, polished)
        levels.append(tuple(grown))
        if (
            not grown
            or is_noise(grown[0].fit)
            or (grown[0].score > nominal.score - HOPELESS * (nominal.score - grown[0].floor()))
        ):
            break
        needed = RIVALS * (nominal.score - grown[0].score)
        parents = [(c, (c.fit,)) for c in grown[:BEAM] if nominal.score - c.score >= needed]
    if len(levels) > 1 and levels[-1] and not is_noise(levels[-1][0].fit):
        levels.append(
            tuple(
                sorted(
                    (*levels[-1], *_replaced(nominal, levels[-1][0], jobs)), key=lambda c: c.score
                )
            )
        )
        del levels[-2]
    return JointSearch(nominal, tuple(levels))


def _replaced(nominal: Composition, best: Composition, jobs: int) -> list[Composition]:
    """Compositions with another effect in the place of each effect but the last one of the best.

    An effect that was chosen while others were missing may stand for what they left open; seen
    beside the others, the right one does better.
    """
    last = CATALOGUE[best.effects[-1]]
    count = len(last.parameters)
    places = range(last.first_parameter, last.first_parameter + count)
    shared = nominal.fit.model
    flags = shared.flags.copy()
    flags[last.flag] = True
    base, _ = best.fit.model.packed(best.fit.theta)
    kept = [
        i
        for i, item in enumerate(best.fit.model.free)
        if item.index < len(NOMINAL_KEYS) or item.index in places
    ]
    model = JointModel(shared.observation, base, flags, tuple(best.fit.model.free[i] for i in kept))
    alone = fit(model, best.fit.theta[kept], iterations=4)
    parent = Composition((best.effects[-1],), alone, score(alone))
    start = Fit(
        model, best.fit.theta[kept], model.residuals(best.fit.theta[kept]), alone.jacobian, np.inf
    )
    return grow([(parent, (start, alone))], searchable_effects(), jobs, REPLACED_POLISHED)
