"""How far apart two rivals' predictions stay, each refitted to the other's."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.physics.effects import CATALOGUE
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

    Parameters
    ----------
    plant : PlantDescription
    observation : JointObservation
    band : float
        Relative freedom of the nominal parameters.
    iterations : int

    Returns
    -------
    Fit
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
    """Put the fitted numbers of one joint back into a plant.

    Returns
    -------
    PlantDescription
    """
    packed, _ = found.model.packed(found.theta)
    joints = {**plant.joints, joint: joint_of(packed)}
    effects = []
    for spec in plant.effects:
        if spec.joint != joint:
            effects.append(spec)
            continue
        definition = CATALOGUE[spec.id]
        first = definition.first_parameter
        effects.append(
            EffectSpec(
                spec.id,
                joint,
                {p.name: float(packed[first + i]) for i, p in enumerate(definition.parameters)},
            )
        )
    return replace(plant, joints=joints, effects=tuple(effects))


def distance(truth: Recording, rival: PlantDescription, joint: str) -> float:
    """Return what a rival misses of an imagined recording after its refit.

    Parameters
    ----------
    truth : Recording
        Noise-free answer of the other rival.
    rival : PlantDescription
    joint : str
        The joint in question.

    Returns
    -------
    float
        Root mean square over all samples of the joint's signals, in noise units.
    """
    observation = next(o for o in observe(truth, rival) if o.joint == joint)
    found = refit(rival, observation, NOMINAL_BAND, REFIT_STEPS)
    return float(np.sqrt(np.mean(found.residuals**2)))
