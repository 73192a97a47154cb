"""Size of the loop that the wires' tensions draw, where no tip is seen."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.metrics import width_at_mid_height


def tension_loop_width(
    desired: ArrayLike, tension_positive: ArrayLike, tension_negative: ArrayLike
) -> float:
    """Width, in the unit of the angle (N,), of the loop of both wires' tension difference in N.

    Angle and tensions are in time order, over at least one whole loop; it is measured like the
    backlash size, and raises ValueError as `width_at_mid_height`.
    """
    # The difference of the tensions is the load of the joint's drive, and leads the desired angle:
    # at a reversal friction turns round at the motor first. On real recordings its width falls
    # along a straight line with the backlash size; on the simulated rig it falls from a capstan
    # exponent of 0.7 on, and hardly changes below.
    difference = np.asarray(tension_negative, dtype=float) - np.asarray(tension_positive)
    return width_at_mid_height(desired, difference)


def leave_one_out_errors(feature: ArrayLike, target: ArrayLike) -> NDArray[np.float64]:
    """Errors (R,) of a straight line through all other points, at each of R >= 3 points."""
    x, y = np.asarray(feature, dtype=float), np.asarray(target, dtype=float)
    errors = np.empty_like(y)
    for k in range(len(y)):
        others = np.arange(len(y)) != k
        slope, intercept = np.polyfit(x[others], y[others], 1)
        errors[k] = slope * x[k] + intercept - y[k]
    return errors
