"""Score-test screening: what one simulation of an effect promises before any fit.

An effect at a starting value moves the residual along some direction. What is left of it after
the nominal parameters have done their best is projected on the residual, which is Rao's score
test with a difference in place of the derivative (Rao, Proc. Camb. Phil. Soc. 44, 1948).
"""

import math
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.fit.free_parameters import effect_parameters, with_free_reference
from endoscope_explain.fit.model import Fit, JointModel

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
        Predicted fall of the half deviance, at the best multiple of the effect where it is linear.
    """

    effect_id: str
    start: dict[str, float]
    gain: float


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
        value = start.get(parameter.name, parameter.typical)
        base[definition.first_parameter + i] = (
            model.observation.duration if parameter.is_duration else value
        )
    free = with_free_reference(model.free, effect_id) + effect_parameters(effect_id)
    return JointModel(model.observation, base, flags, free)


@dataclass(frozen=True)
class Unexplained:
    """What a fit leaves, beyond what its own parameters could still do.

    Attributes
    ----------
    fit : Fit
    span : array (size + n, n)
        Orthonormal directions in which the parameters move the residual and the priors' deviations.
    left : array (size + n,)
        Residuals and deviations across these directions.
    """

    fit: Fit
    span: Array = field(repr=False)
    left: Array = field(repr=False)


def unexplained(anchor: Fit, weight: Array | None = None) -> Unexplained:
    """What a fit leaves to effects that it does not have, its residuals weighted (size,) if so."""
    model = anchor.model
    weight = np.ones(len(anchor.residuals)) if weight is None else weight
    slopes = anchor.jacobian * weight[:, None]
    span, _ = np.linalg.qr(np.vstack([slopes, np.diag(model.prior_weight())]))
    here = np.concatenate([anchor.residuals * weight, model.prior(anchor.theta)])
    left = here - span @ (span.T @ here)
    return Unexplained(anchor, span, left)


def promises(background: Unexplained, effect_id: str) -> list[Promise]:
    """Promises of an effect at all its starting points, best first.

    Parameters
    ----------
    background : Unexplained
        Fit without the effect; its residual is to be explained.
    effect_id : str

    Returns
    -------
    list of Promise
    """
    anchor, span = background.fit, background.span
    linear = not any(p.scale for p in CATALOGUE[effect_id].parameters)
    found = []
    for start in starting_points(effect_id):
        model = with_effect(anchor.model, effect_id, start)
        theta = model.begun_at(anchor.theta)
        moved = np.concatenate(
            [model.residuals(theta) - anchor.residuals, np.zeros(len(anchor.theta))]
        )
        moved -= span @ (span.T @ moved)
        size = float(moved @ moved)
        towards = -float(moved @ background.left)
        ratio = towards / size if size > 1e-6 else 0.0
        if ratio < 0.0 and linear:
            start, ratio, towards = _mirrored(effect_id, start), -ratio, -towards
        if not linear:
            ratio = 1.0
        if start:
            found.append(Promise(effect_id, start, ratio * towards - 0.5 * ratio * ratio * size))
    return sorted(found, key=lambda p: -p.gain)


def _mirrored(effect_id: str, start: dict[str, float]) -> dict[str, float]:
    """Return the start on the other side of no effect at all; empty where there is none."""
    mirrored, changed = dict(start), False
    for parameter in CATALOGUE[effect_id].parameters:
        value = start[parameter.name]
        if parameter.phase:
            mirrored[parameter.name], changed = value - math.copysign(math.pi, value), True
            continue
        other = 2.0 * parameter.off - value
        if parameter.low < parameter.off and parameter.low <= other <= parameter.high:
            mirrored[parameter.name] = other
            changed = changed or other != value
    return mirrored if changed else {}
