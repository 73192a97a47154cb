"""How far apart two rivals' predictions stay, each refitted to the other's."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.effects import describe
from endoscope_explain.decide.conclusions import spec_of
from endoscope_explain.fit.free_parameters import LEAD, effect_parameters, nominal_parameters
from endoscope_explain.fit.model import Fit, JointModel, fit
from endoscope_explain.fit.simulated_joint import joint_of, packed_joint
from endoscope_explain.observe.observation import JointObservation, observe
from endoscope_explain.recording import Recording

Array = NDArray[np.float64]

NOMINAL_BAND = 0.05
"""Relative freedom that nominal parameters still have after a first recording."""
REFIT_STEPS = 3


def refit(
    plant: PlantDescription, observation: JointObservation, band: float, iterations: int
) -> Fit:
    """Refit one joint of a plant, its effects included, from where it is.

    `band`: relative freedom of the nominal parameters.
    """
    base, flags = packed_joint(plant, observation.joint)
    free = nominal_parameters(base, band)
    for spec in plant.effects:
        if spec.joint == observation.joint:
            free += effect_parameters(spec.id)
    model = JointModel(observation, base, flags, free)
    start = np.array(
        [item.coordinate(1.0 if item.index == LEAD else float(base[item.index])) for item in free]
    )
    return fit(model, start, iterations=iterations)


def with_fit(plant: PlantDescription, joint: str, found: Fit) -> PlantDescription:
    """Put the fitted numbers of one joint back into a plant."""
    packed, _ = found.model.packed(found.theta)
    effects = tuple(
        spec_of(describe(spec.id), joint, packed) if spec.joint == joint else spec
        for spec in plant.effects
    )
    return replace(plant, joints={**plant.joints, joint: joint_of(packed)}, effects=effects)


def distance(truth: Recording, rival: PlantDescription, joint: str) -> float:
    """What a rival misses of the other rival's noise-free answer after its refit.

    Returns: root mean square over all samples of the joint's signals, in noise units.
    """
    observation = next(o for o in observe(truth, rival) if o.joint == joint)
    found = refit(rival, observation, NOMINAL_BAND, REFIT_STEPS)
    return float(np.sqrt(np.mean(found.residuals**2)))
