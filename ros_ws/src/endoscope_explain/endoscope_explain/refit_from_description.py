"""Fit compositions of effects again, with the nominal parameters as described to start from.

One effect fitted while another one was missing bends the nominal parameters so far that a fit of
both stays in a valley of that corner, and its discrete numbers were chosen in that corner, too.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from endoscope_core.effects import CATALOGUE
from endoscope_explain.compose import Composition, polished
from endoscope_explain.fit import Fit, JointModel
from endoscope_explain.rank import Look


def from_description(found: Sequence[Composition], described: Fit, jobs: int) -> list[Composition]:
    """Fit each composition from the described plant, with its effects' numbers as found.

    Parameters
    ----------
    found : sequence of Composition
    described : Fit
        The nominal plant as described.
    jobs : int
        Processes side by side.

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
