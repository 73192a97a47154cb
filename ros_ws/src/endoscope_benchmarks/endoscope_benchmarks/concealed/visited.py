"""Which values of each state a motion visits."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics import PlantDescription, simulate
from endoscope_core.physics.functions import places
from endoscope_core.physics.functions.place import Argument
from endoscope_core.physics.simulator import TICK

Array = NDArray[np.float64]

PERIODS_S = (1.5, 6.0)
CYCLES = (3.0, 10.0)
"""Of a law that repeats with the shaft, over the shaft's range."""
_EDGE = 0.005
"""Quantile at which the range of a speed ends."""


def visited(
    plant: PlantDescription, command: Array, joint: str
) -> dict[Argument, tuple[float, float]]:
    """Range of the argument of every place; of one that repeats, that of its period.

    Parameters
    ----------
    plant : PlantDescription
    command : array (N, J)
        Motor shaft command in rad, every ms.
    joint : str
    """
    answer, names = simulate(plant, command), plant.joint_names()
    j, own = names.index(joint), plant.joints[joint]
    angle, shaft = answer.bending_true[:, j], answer.shaft_position[:, j]
    speed, asked = answer.shaft_velocity[:, j], command[:, j]
    wound = own.pulley_radius * shaft
    slid = np.abs(own.pulley_radius * speed)
    pair = answer.tension[:, j]
    other = answer.bending_true[:, 1 - j] if len(names) == 2 else np.zeros(1)
    found = {
        places.TIME: answer.time,
        places.SPEED: np.array([0.0, np.quantile(slid, 1.0 - _EDGE)]),
        places.DISTANCE: np.array([0.0, np.sum(slid) * TICK]),
        places.TENSION: pair,
        places.BOTH_TENSIONS: pair.mean(axis=1),
        places.DIFFERENCE: pair[:, 0] - pair[:, 1],
        places.ANGLE: angle,
        places.OTHER_ANGLE: other,
        places.ANGULAR_SPEED: np.quantile(np.gradient(angle, TICK), [_EDGE, 1.0 - _EDGE]),
        places.SHAFT: shaft,
        places.SHAFT_SPEED: np.quantile(speed, [_EDGE, 1.0 - _EDGE]),
        places.COMMANDED: asked,
        places.SERVO: asked - shaft,
        places.WOUND: np.concatenate([wound, -wound]),
        places.READING: pair,
        places.NEIGHBOUR: pair,
        places.CYCLE: np.array(PERIODS_S),
        places.CYCLE_OF_SHAFT: np.ptp(shaft) / np.array(CYCLES),
    }
    return {key: (float(values.min()), float(values.max())) for key, values in found.items()}
