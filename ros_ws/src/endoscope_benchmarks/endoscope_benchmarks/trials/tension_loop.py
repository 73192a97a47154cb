"""Size of the loop that the wires' tensions draw, where no tip is seen."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.metrics.backlash_size import width_at_mid_height


def tension_loop_width(
    desired: ArrayLike, tension_positive: ArrayLike, tension_negative: ArrayLike
) -> float:
    """Width of the loop of both wires' tension difference, measured like the backlash size.

    The difference of the tensions is the load of the joint's drive, and leads the desired angle: at
    a reversal friction turns round at the motor first. On real recordings its width falls along a
    straight line with the backlash size; on the simulated rig it falls from a capstan exponent of
    0.7 on, and hardly changes below.

    `desired` (N,): angle, in time order, over at least one whole loop.
    `tension_positive`, `tension_negative` (N,): tensions in N of the wires that pull towards
        positive and negative angles.
    Returns: in the unit of `desired`.
    Raises ValueError: as `width_at_mid_height`.
    """
    difference = np.asarray(tension_negative, dtype=float) - np.asarray(tension_positive)
    return width_at_mid_height(desired, difference)


def leave_one_out_errors(feature: ArrayLike, target: ArrayLike) -> NDArray[np.float64]:
    """Errors (R,) of a straight line through all other points, at each of R >= 3 points.

    Shapes: `feature`, `target` (R,).
    """
    x, y = np.asarray(feature, dtype=float), np.asarray(target, dtype=float)
    errors = np.empty_like(y)
    for k in range(len(y)):
        others = np.arange(len(y)) != k
        slope, intercept = np.polyfit(x[others], y[others], 1)
        errors[k] = slope * x[k] + intercept - y[k]
    return errors
