"""The held-out blocks of a recording, by time."""

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.held_out import BLOCK_S, EVERY, GAP_S

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def judged(time: Array) -> Mask:
    """Tell which samples physics and black boxes are judged on; all where there is no block.

    Parameters
    ----------
    time : array (N,)
        In s from the first command.
    """
    inside = np.mod(time, BLOCK_S * EVERY) >= BLOCK_S * (EVERY - 1)
    return inside if inside.any() else np.ones_like(inside)


def trained_on(time: Array) -> Mask:
    """Tell which samples may be trained on: those that are not near a held-out block.

    Parameters
    ----------
    time : array (N,)
        In s from the first command.
    """
    phase = np.mod(time, BLOCK_S * EVERY)
    return (phase < BLOCK_S * (EVERY - 1) - GAP_S) & (phase >= GAP_S)
