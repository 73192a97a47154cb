"""Rotations as unit quaternions x, y, z, w.

Products follow Hamilton: ``multiply(a, b)`` turns by ``b`` first, then by ``a``
(Diebel, "Representing Attitude", Stanford 2006, sections 6.1 to 6.4).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def unit_quaternion(quaternion: ArrayLike) -> Array:
    """A quaternion scaled to length one.

    Parameters
    ----------
    quaternion
        x, y, z, w of any length but zero, shape (4,).

    Returns
    -------
    ndarray, shape (4,)

    Raises
    ------
    ValueError
        It is zero or not finite.
    """
    q = np.asarray(quaternion, dtype=float)
    norm = float(np.linalg.norm(q))
    if not math.isfinite(norm) or norm == 0.0:
        raise ValueError(f'{q} is not an orientation')
    return q / norm


def conjugate(quaternion: ArrayLike) -> Array:
    """The inverse of a rotation.

    Parameters
    ----------
    quaternion
        Unit quaternion, shape (4,).

    Returns
    -------
    ndarray, shape (4,)
    """
    x, y, z, w = np.asarray(quaternion, dtype=float)
    return np.array([-x, -y, -z, w])


def multiply(first: ArrayLike, second: ArrayLike) -> Array:
    """The rotation by ``second`` and then by ``first``.

    Parameters
    ----------
    first, second
        Unit quaternions, shape (4,).

    Returns
    -------
    ndarray, shape (4,)
    """
    ax, ay, az, aw = np.asarray(first, dtype=float)
    bx, by, bz, bw = np.asarray(second, dtype=float)
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def rotate(quaternion: ArrayLike, vector: ArrayLike) -> Array:
    """A vector turned by a rotation.

    Parameters
    ----------
    quaternion
        Unit quaternion, shape (4,).
    vector
        Shape (3,), any unit.

    Returns
    -------
    ndarray, shape (3,)
    """
    q = np.asarray(quaternion, dtype=float)
    v = np.asarray(vector, dtype=float)
    twice = 2.0 * np.cross(q[:3], v)
    return v + q[3] * twice + np.cross(q[:3], twice)


def about_z(angle: float) -> Array:
    """The rotation by ``angle`` (rad) about the z axis, shape (4,).

    Parameters
    ----------
    angle
        In rad.
    """
    return np.array([0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)])


def angle_between(first: ArrayLike, second: ArrayLike) -> float:
    """Angle of the rotation that leads from one orientation to another.

    Parameters
    ----------
    first, second
        Unit quaternions, shape (4,); q and -q are the same orientation.

    Returns
    -------
    float
        In rad, from 0 to pi.
    """
    x, y, z, w = multiply(conjugate(first), second)
    return 2.0 * math.atan2(math.hypot(x, y, z), abs(w))


def mean_orientation(quaternions: ArrayLike) -> Array:
    """The orientation with the least mean square distance to all given.

    The eigenvector of the largest eigenvalue of the sum of outer products (Markley, Cheng,
    Crassidis and Oshman, J. Guidance, Control, and Dynamics 30(4), 2007, equations 12 and 13),
    which takes q and -q as the same.

    Parameters
    ----------
    quaternions
        Unit quaternions, shape (N, 4) with N > 0.

    Returns
    -------
    ndarray, shape (4,)
        With w >= 0.

    Raises
    ------
    ValueError
        There is none, or one is not finite.
    """
    q = np.asarray(quaternions, dtype=float)
    if q.ndim != 2 or q.shape[1] != 4 or len(q) == 0 or not np.all(np.isfinite(q)):
        raise ValueError('the mean needs at least one finite quaternion, shape (N, 4)')
    mean = np.linalg.eigh(q.T @ q)[1][:, -1]
    return mean if mean[3] >= 0.0 else -mean
