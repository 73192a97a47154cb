"""What the size model reads of a calibration: the course of both wires' tensions of each joint."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PERIOD = 1e-3
BIN = 50
WIRES_OF_A_JOINT = 2
SLACK = 0.5
"""Tension in N that is added before the logarithm, which a slack wire has none of."""


def log_courses(tension: Array) -> Array:
    """Logarithms of tensions averaged over 50 ms, (R, J, 2 B), the positive wire's first.

    Recordings begin at the same place on the loop, so that an instant of one is a place on it:
    these are the tension loops themselves, with a seventh of the cells' noise.

    Parameters
    ----------
    tension : ndarray, shape (R, N, 2 J)
        N at 1 kHz, two wires a joint. Samples after the last whole 50 ms are left out.
    """
    recordings, samples, wires = tension.shape
    bins = samples // BIN
    mean = tension[:, : bins * BIN].reshape(recordings, bins, BIN, wires).mean(axis=2)
    by_joint = mean.transpose(0, 2, 1).reshape(recordings, wires // WIRES_OF_A_JOINT, -1)
    return np.log(np.maximum(by_joint, 0.0) + SLACK)


def roughness(tension: Array) -> Array:
    """Noise of each cell in N rms (R, J, 2), from second differences.

    Smooth motion adds next to nothing to a second difference at 1 kHz, and white noise has
    sqrt(6) times its own rms in it.
    """
    rms = np.sqrt(np.mean(np.square(np.diff(tension, 2, axis=1)), axis=1) / 6.0)
    return rms.reshape(len(rms), -1, WIRES_OF_A_JOINT)


def variance_of_fewer_readings(course: Array, noise: Array, interval: float) -> Array:
    """Variance of log courses (R, J, 2 B) by which readings at intervals exceed those at 1 kHz.

    A straight line between readings of white noise at intervals T covaries over a time u as the
    cubic B-spline of u / T, whose mean absolute deviation is 7/15: over a bin of length t the
    variance of the mean is ``T/t (1 - 7/15 T/t)`` of that of one reading, for ``T <= t / 2``.  The
    logarithm divides its root by the mean tension.

    Parameters
    ----------
    course : ndarray, shape (R, J, 2 B)
        As `log_courses` gives them.
    noise : ndarray, shape (J, 2) or (R, J, 2)
        Rms of one reading of each cell in N.
    interval : float
        Between readings in s.
    """
    share = interval / (BIN * PERIOD)
    more = max(0.0, share * (1.0 - 7.0 / 15.0 * share) - 1.0 / BIN)
    by_wire = np.exp(-2.0 * course).reshape(*course.shape[:2], WIRES_OF_A_JOINT, -1)
    return more * (np.square(noise)[..., None] * by_wire).reshape(course.shape)
