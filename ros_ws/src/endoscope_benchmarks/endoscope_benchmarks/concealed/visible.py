"""What is left of a law once the numbers of the rig are fitted: whether anybody can see it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_benchmarks.concealed.readings import in_noise, read, worst_rms
from endoscope_benchmarks.concealed.rigs import spreads, with_number
from endoscope_core.physics import PlantDescription

Array = NDArray[np.float64]

STEP = 0.1
"""Of a difference, in spreads."""


def left(bare: PlantDescription, true: PlantDescription, command: Array) -> float:
    """What a refit leaves of a law, over the noise (rms), of the signal that shows it most.

    The refit is linear, around the rig without the law, and holds the rig's numbers to the spreads
    from which they are drawn.

    Parameters
    ----------
    bare, true : PlantDescription
        The rig without the law and with it.
    command : array (N, J)
        Motor shaft command in rad, every ms.
    """

    def seen(plant: PlantDescription) -> list[Array]:
        return in_noise(read(plant, command).signals(), bare.sensors)

    without = seen(bare)
    sizes = np.cumsum([len(column) for column in without])[:-1]
    start = np.concatenate(without)
    law = np.concatenate(seen(true)) - start
    slopes = []
    for name, joint in bare.joints.items():
        for key, spread in spreads(joint).items():
            other = with_number(joint, key, STEP * spread)
            plant = replace(bare, joints={**bare.joints, name: other})
            slopes.append((np.concatenate(seen(plant)) - start) / STEP)
    jacobian = np.column_stack(slopes)
    held = jacobian.T @ jacobian + np.eye(len(slopes))
    return worst_rms(np.split(law - jacobian @ np.linalg.solve(held, jacobian.T @ law), sizes))
