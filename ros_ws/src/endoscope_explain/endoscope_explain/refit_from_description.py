"""Fit effects with the nominal parameters as described to start from.

What is missing bends the nominal parameters of a refit so far that the right effect no longer
promises anything, or that a fit of two effects stays in a valley of that corner, with discrete
numbers that were chosen there.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.compose import Composition, polished
from endoscope_explain.fit.model import Fit, JointModel
from endoscope_explain.parallel import parallel_map
from endoscope_explain.rank import Look
from endoscope_explain.screen import promises, unexplained, with_effect

PROMISING = 2
"""Effects that are fitted, of all that promise something to the described plant."""


def from_description(found: Sequence[Composition], described: Fit, jobs: int) -> list[Composition]:
    """Fit each composition from the described plant, with its effects' numbers as found.

    Parameters
    ----------
    found : sequence of Composition
    described : Fit
        The nominal plant as described.
    jobs : int
        Tasks side by side.

    Returns
    -------
    list of Composition
        One for each combination of discrete choices of all effects but the one added last.
    """
    nominal = len(described.theta)
    looks = [
        Look(
            c.effects,
            model,
            np.concatenate([described.theta, c.fit.theta[nominal:]]),
            c.fit.cost,
        )
        for c in found
        for model in _with_all_choices(c.fit.model, c.effects[:-1])
    ]
    return polished(looks, jobs)


def promised_by_description(
    described: Fit, effect_ids: Sequence[str], jobs: int
) -> list[Composition]:
    """Fit the single effects that promise most to the described plant.

    Parameters
    ----------
    described : Fit
        The nominal plant as described.
    effect_ids : sequence of str
        Those that may be chosen.
    jobs : int
        Tasks side by side.

    Returns
    -------
    list of Composition
    """
    left = unexplained(described)
    found = parallel_map(lambda effect_id: promises(left, effect_id)[:1], effect_ids, jobs)
    best = sorted((p for own in found for p in own), key=lambda p: -p.gain)[:PROMISING]
    models = [with_effect(described.model, p.effect_id, p.start) for p in best]
    looks = [
        Look((p.effect_id,), model, model.begun_at(described.theta), described.cost)
        for p, model in zip(best, models, strict=True)
    ]
    return polished(looks, jobs)


def _with_all_choices(model: JointModel, effect_ids: Sequence[str]) -> list[JointModel]:
    choices = {
        CATALOGUE[effect_id].first_parameter + i: parameter.choices
        for effect_id in effect_ids
        for i, parameter in enumerate(CATALOGUE[effect_id].parameters)
        if parameter.choices
    }
    models = []
    for combination in product(*choices.values()):
        base = model.base.copy()
        base[list(choices)] = combination
        models.append(replace(model, base=base))
    return models
