"""What the zero of each load cell is off by, as the calibration itself shows it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WORTH_TELLING = 0.3
"""In N: three standard deviations of the poorest zeros that the classifier was trained with."""
_WINDOW = 50


def zero_errors(tension: Array) -> Array:
    """What cells read in N where their wires hang loose, shape (W,).

    At the ends of a calibration motion one wire of a joint pulls and the other is paid out until it
    is slack, for a fifth of the time in the median of simulated tubes. The least mean over 50 ms is
    then the zero, which noise hardly moves.

    Parameters
    ----------
    tension : ndarray, shape (N, W)
        N at 1 kHz, of a whole calibration.
    """
    sums = np.cumsum(tension, axis=0)
    least: Array = ((sums[_WINDOW:] - sums[:-_WINDOW]) / _WINDOW).min(axis=0)
    return least


def words_of(errors: Array, wires: Sequence[str]) -> str:
    """Sentence that names the cells whose zero is off by much of `errors` (N); empty if none is."""
    told = [
        f'{wire} by {error:+.2f} N'
        for wire, error in zip(wires, errors.tolist(), strict=True)
        if abs(error) > WORTH_TELLING
    ]
    return f'zero of a load cell is off: {", ".join(told)}; set it anew' if told else ''
