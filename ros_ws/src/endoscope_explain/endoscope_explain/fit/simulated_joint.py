"""Simulate one joint on its recorded commands and compare with what its sensors read."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_core.physics.kernel import run_joints
from endoscope_core.physics.layout import (
    FRICTION_PROFILE,
    NOMINAL_KEYS,
    OUTPUTS,
    PROFILE_TERMS,
)
from endoscope_core.physics.packing import pack, rest_state
from endoscope_explain.observe.observation import TICK, JointObservation

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def simulate_joint(
    observation: JointObservation,
    parameters: Array,
    flags: Flags,
    inputs: Array | None = None,
) -> Array:
    """Noise-free readings of one joint under the recorded commands.

    `parameters` (parameters,): packed parameters of this joint.
    `flags` (flags,): effects that are on.
    `inputs` (1, N, INPUTS): instead of the observation's own, for cut chains.
    Returns (N, OUTPUTS).
    """
    inputs = observation.inputs if inputs is None else inputs
    packed, on = parameters[None], flags[None]
    speed = np.array([observation.start_speed])
    start = rest_state(packed, on, observation.tick, observation.start[None], speed)
    out = np.empty((1, inputs.shape[1], OUTPUTS))
    run_joints(*start, packed, on, inputs, False, observation.tick, out)
    return out[0]


def residuals(
    observation: JointObservation, outputs: Array, lead: float = 0.0, skew: float = 0.0
) -> Array:
    """Return simulated minus measured, in units of the known noise, all channels in a row (size,).

    `lead` in units of `TICK` and `skew` of the tracker's clock are as in `Channel.predicted`.
    """
    lead *= TICK / observation.tick
    return np.concatenate(
        [
            (
                channel.predicted(outputs, lead, skew if channel.quantity == 'bending' else 0.0)
                - channel.value
            )
            / channel.noise
            for channel in observation.channels
        ]
    )


def packed_joint(plant: PlantDescription, joint: str) -> tuple[Array, Flags]:
    """Parameters (parameters,) and flags (flags,) of one joint of a plant."""
    parameters, flags = pack(plant)
    index = plant.joint_names().index(joint)
    return parameters[index], flags[index]


def joint_of(parameters: Array) -> JointParameters:
    """The nominal parameters of a joint packed as `parameters` (parameters,)."""
    numbers = dict(zip(NOMINAL_KEYS, parameters.tolist(), strict=False))
    profile = parameters[FRICTION_PROFILE : FRICTION_PROFILE + PROFILE_TERMS]
    terms = int(np.max(np.flatnonzero(profile), initial=-1)) + 1
    return JointParameters(**numbers, friction_profile=tuple(profile[:terms].tolist()))
