"""Simulate one joint on its recorded commands and compare with what its sensors read."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.plant import PlantDescription
from endoscope_core.plant.kernel import OUTPUTS, run_joints
from endoscope_core.plant.packing import pack, rest_state
from endoscope_explain.observation import TICK, JointObservation

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SUBSTEPS = 3
"""Integration steps in a tick: 2e-3 N and 1e-4 rad from the exact solution."""
COARSE_SUBSTEPS = 1
"""The same where a plant is compared with one that differs little from it."""


def simulate_joint(
    observation: JointObservation,
    parameters: Array,
    flags: Flags,
    inputs: Array | None = None,
    substeps: int = SUBSTEPS,
) -> Array:
    """Noise-free readings of one joint under the recorded commands.

    Parameters
    ----------
    observation : JointObservation
    parameters : array (parameters,)
        Packed parameters of this joint.
    flags : array (flags,) of bool
        Effects that are on.
    inputs : array (1, N, INPUTS), optional
        Instead of the observation's own, for latent pushes or cut chains.
    substeps : int
        Integration steps in a tick.

    Returns
    -------
    array (N, OUTPUTS)
    """
    inputs = observation.inputs if inputs is None else inputs
    packed = parameters[None]
    states, histories = rest_state(packed, np.array([observation.start]))
    out = np.empty((1, inputs.shape[1], OUTPUTS))
    run_joints(states, histories, packed, flags[None], inputs, False, TICK, substeps, out)
    return out[0]


def residuals(
    observation: JointObservation, outputs: Array, lead: float = 0.0, skew: float = 0.0
) -> Array:
    """Return simulated minus measured, in units of the known noise, all channels in a row (size,).

    `lead` in ticks and `skew` of the tracker's clock are as in `Channel.predicted`.
    """
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
