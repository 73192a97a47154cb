"""Noise of a sensor as its own readings show it: fast scatter, and the steps in which they come.

Motion faster than the analysis grid counts as noise of the samples that it blurs. Stick-slip
makes tensions jump many times within one analysis sample. No simulation gets the instant of each
slip right, so what the readings themselves scatter by, beyond their sensor's noise, is added to it.
"""

from math import pi, sqrt

import numpy as np

from endoscope_explain.recording import Array

WINDOW = 250
"""Raw samples over which the scatter is estimated."""
SIGNIFICANT = 1.3
"""Scatter, in units of the noise, from which on it is taken for motion."""
QUIET = 0.1
"""Share of the recording in which nothing slips; a sensor worse than described is no motion."""
STEPS_SEEN = 20
"""Changes of a reading from which on its step is seen: that half of so many continuous ones are
alike, within a hundredth, has a chance of 1e-15."""
_SAME_READING = 1e-6
"""Relative difference of two readings that are one, written in single precision."""


def fast_scatter(values: Array, white: float) -> Array:
    """Scatter (R,) of equally spaced raw readings beyond their white noise (rms), one by one."""
    # Third differences take out what is smooth over four samples; their variance is 20 times that
    # of the samples (von Neumann et al., Ann. Math. Stat. 12, 1941, for first differences).
    if len(values) < WINDOW:
        return np.zeros(len(values))
    squares = np.concatenate([np.zeros(3), np.diff(values, 3) ** 2 / 20.0])
    # The median within the window would hide slips, the mean hears each of them.
    kernel = np.ones(WINDOW) / WINDOW
    local = np.convolve(np.pad(squares, WINDOW // 2, mode='edge'), kernel, mode='same')
    local = local[WINDOW // 2 : WINDOW // 2 + len(values)]
    quiet = max(white**2, float(np.quantile(local, QUIET)))
    return np.where(local > SIGNIFICANT**2 * quiet, np.sqrt(local), 0.0)


def rounding_error(step: float, white: float) -> float:
    """Part (rms) of the error of rounding to steps that a mean over readings does not lessen."""
    # White noise spreads readings over several steps; what it leaves of the error is a function of
    # the reading's true value (Widrow, Kollar, Quantization Noise, 2008, ch. 19).
    if step == 0.0:
        return 0.0
    k = np.arange(1.0, 100.0)
    left = np.exp(-((2.0 * pi * k * white / step) ** 2)) / k**2
    # The series of 1 / k^2 is summed to its end, as step^2 / 12 is without any noise.
    return float(step * sqrt(np.sum(left) / np.sum(1.0 / k**2) / 12.0))


def step_read(values: Array) -> float:
    """Step in which readings (M,) come, one after the other; 0 where it is not seen."""
    # A sensor may be coarser than described.
    change = np.abs(np.diff(values))
    change = change[change > _SAME_READING * np.max(np.abs(values), initial=0.0)]
    if len(change) < STEPS_SEEN:
        return 0.0
    least = np.min(change)
    # Readings that go on by single steps show them; where noise is wider it hides them as well.
    return float(least) if np.mean(change < 1.01 * least) >= 0.5 else 0.0
