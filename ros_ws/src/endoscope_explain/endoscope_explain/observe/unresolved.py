"""Motion that is faster than the analysis grid, as noise of the samples that it blurs.

Stick-slip makes tensions jump many times within one analysis sample. No simulation gets the
instant of each slip right, so what the readings themselves scatter by, beyond their sensor's
noise, is added to the noise there.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

WINDOW = 250
"""Raw samples over which the scatter is estimated."""
SIGNIFICANT = 1.3
"""Scatter, in units of the noise, from which on it is taken for motion."""
QUIET = 0.1
"""Share of the recording in which nothing slips; a sensor worse than described is no motion."""


def fast_scatter(values: Array, white: float) -> Array:
    """Scatter of raw readings beyond their white noise, sample by sample.

    Third differences take out what is smooth over four samples; their variance is 20 times that
    of the samples (von Neumann et al., Ann. Math. Stat. 12, 1941, for first differences).

    `values` (R,): equally spaced raw readings.
    `white`: known noise (rms), not zero.
    Returns (R,): in the readings' unit; zero where they show no more than their noise.
    """
    if len(values) < WINDOW:
        return np.zeros(len(values))
    squares = np.concatenate([np.zeros(3), np.diff(values, 3) ** 2 / 20.0])
    # The median within the window would hide slips, the mean hears each of them.
    kernel = np.ones(WINDOW) / WINDOW
    local = np.convolve(np.pad(squares, WINDOW // 2, mode='edge'), kernel, mode='same')
    local = local[WINDOW // 2 : WINDOW // 2 + len(values)]
    quiet = max(white**2, float(np.quantile(local, QUIET)))
    return np.where(local > SIGNIFICANT**2 * quiet, np.sqrt(local), 0.0)
