"""Simulate joints on their recorded commands, recording after recording where there are several."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from endoscope_core.physics.kernel import run_joints, turn_to
from endoscope_core.physics.layout import MOTOR_SPEED, OUTPUTS
from endoscope_core.physics.packing import rest_state
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.recording import Array, Mask


def simulate_joints(
    observations: Sequence[JointObservation],
    parameters: Array,
    flags: Mask,
    inputs: Array | None = None,
) -> Array:
    """Noise-free readings (J, N, OUTPUTS) of joints side by side under recorded, or other, inputs.

    `parameters` are (J, parameters), `flags` (J, flags), `inputs` (J, N, INPUTS).
    """
    inputs = np.concatenate([o.inputs for o in observations]) if inputs is None else inputs
    tick, coupled = observations[0].tick, len(observations) > 1
    ways = np.stack([o.start for o in observations])
    speeds = np.array([o.start_speed for o in observations])
    states, histories, sheaths = rest_state(parameters, flags, tick, ways, speeds)
    restarts = [o.restarts for o in observations]
    ends = [0, *(each.tick for each in restarts[0]), inputs.shape[1]]
    taken = []
    for part, (begin, end) in enumerate(pairwise(ends)):
        for j, own in enumerate(restarts if part else ()):
            # Time, and what has crept or worn, goes on; the motor comes as this recording has it.
            for angle in own[part - 1].way:
                turn_to(states[j], histories[j], sheaths[j], parameters[j], flags[j], angle)
            states[j, MOTOR_SPEED] = own[part - 1].speed
        out = np.empty((len(observations), end - begin, OUTPUTS))
        commands = np.ascontiguousarray(inputs[:, begin:end])
        run_joints(states, histories, sheaths, parameters, flags, commands, coupled, tick, out)
        taken.append(out)
    return taken[0] if len(taken) == 1 else np.concatenate(taken, axis=1)
