"""Catalogue of physics that can be added to the nominal plant, one file an effect.

An effect's module enters it in the catalogue; a new file in this folder is all that a new effect
needs. Modules without an effect hold laws that several share.
"""

import importlib
import pkgutil

import numpy as np
from numpy.typing import NDArray

from endoscope_core.errors import InputError, nearest
from endoscope_core.physics.effect import (
    Effect,
    NominalPhysics,
    Symptom,
    in_order_of_chain,
)

for _module in sorted(module.name for module in pkgutil.iter_modules(__path__)):
    importlib.import_module(f'{__name__}.{_module}')

CATALOGUE: dict[str, Effect] = in_order_of_chain(Effect)
"""All effects by their ids, in the order of the chain."""
NOMINAL_PHYSICS: dict[str, NominalPhysics] = in_order_of_chain(NominalPhysics)
"""What the nominal plant is made of, by its ids, in the order of the chain."""
KNOWN: dict[str, Effect] = {**CATALOGUE, **NOMINAL_PHYSICS}
"""All physics that a plant may lack, by its ids."""


def describe(effect_id: str) -> Effect:
    """The effect, or the nominal physics, of that id; an InputError names the nearest."""
    if effect_id not in KNOWN:
        raise InputError(f'unknown effect {effect_id}: {nearest(effect_id, KNOWN)}')
    return KNOWN[effect_id]


def lacking(packed: NDArray[np.float64]) -> tuple[NominalPhysics, ...]:
    """Nominal physics that a joint of packed parameters (parameters,) lacks."""
    return tuple(each for each in NOMINAL_PHYSICS.values() if each.is_lacking(packed))


def showing(symptom: Symptom) -> Effect:
    """The effect that a recording shows by a symptom."""
    return next(effect for effect in CATALOGUE.values() if effect.traits.symptom is symptom)
