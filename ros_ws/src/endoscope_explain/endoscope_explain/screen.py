"""Score-test screening: what one simulation of an effect promises before any fit.

An effect at a starting value moves the residual along some direction. What is left of it after
the nominal parameters have done their best is projected on the residual, which is Rao's score
test with a difference in place of the derivative (Rao, Proc. Camb. Phil. Soc. 44, 1948).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from endoscope_core.effects import CATALOGUE
from endoscope_explain.fit import Fit, JointModel
from endoscope_explain.free_parameters import effect_parameters, with_free_reference

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Promise:
    """What an effect at one starting point promises.

    Attributes
    ----------
    effect_id : str
    start : dict
        Parameters by name.
    gain : float
        Predicted fall of the half deviance.
    ratio : float
        Best multiple of the effect at this start.
    """

    effect_id: str
    start: dict[str, float]
    gain: float
    ratio: float


def starting_points(effect_id: str) -> list[dict[str, float]]:
    """Combinations of an effect's starting values and discrete choices, each once."""
    parameters = CATALOGUE[effect_id].parameters
    values = [tuple(dict.fromkeys(p.choices or p.starts or (p.typical,))) for p in parameters]
    return [
        dict(zip([p.name for p in parameters], combination, strict=True))
        for combination in product(*values)
    ]


def with_effect(model: JointModel, effect_id: str, start: dict[str, float]) -> JointModel:
    """The model with one more effect, its parameters at `start` and free."""
    definition = CATALOGUE[effect_id]
    base, flags = model.base.copy(), model.flags.copy()
    flags[definition.flag] = True
    for i, parameter in enumerate(definition.parameters):
        base[definition.first_parameter + i] = start.get(parameter.name, parameter.typical)
    free = with_free_reference(model.free, effect_id) + effect_parameters(effect_id)
    return JointModel(model.observation, base, flags, free)


def promises(anchor: Fit, effect_ids: Iterable[str]) -> list[Promise]:
    """Promises of effects at all their starting points, best first.

    Parameters
    ----------
    anchor : Fit
        Fit without the effect; its residual is to be explained.
    effect_ids : iterable of str

    Returns
    -------
    list of Promise
    """
    span, _ = np.linalg.qr(anchor.jacobian)
    left = anchor.residuals - span @ (span.T @ anchor.residuals)
    found = []
    for effect_id in effect_ids:
        for start in starting_points(effect_id):
            model = with_effect(anchor.model, effect_id, start)
            own = [
                item.coordinate(float(model.base[item.index]))
                for item in model.free[len(anchor.theta) :]
            ]
            moved = model.residuals(np.concatenate([anchor.theta, own])) - anchor.residuals
            moved -= span @ (span.T @ moved)
            size = float(moved @ moved)
            ratio = -float(moved @ left) / size if size > 1e-6 else 0.0
            if ratio < 0.0:
                start, ratio = _mirrored(effect_id, start), -ratio
            if start:
                found.append(Promise(effect_id, start, 0.5 * ratio * ratio * size, ratio))
    return sorted(found, key=lambda p: -p.gain)


def _mirrored(effect_id: str, start: dict[str, float]) -> dict[str, float]:
    """Return the start on the other side of no effect at all; empty where there is none."""
    mirrored, changed = dict(start), False
    for parameter in CATALOGUE[effect_id].parameters:
        other = 2.0 * parameter.off - start[parameter.name]
        if parameter.low < parameter.off and parameter.low <= other <= parameter.high:
            mirrored[parameter.name] = other
            changed = changed or other != start[parameter.name]
    return mirrored if changed else {}
