"""Tip pose of a bending section that bends about two axes with constant curvature.

The section is an arc of fixed length whose plane and total angle are given by two bending angles
(Webster and Jones, Int. J. Robotics Research 29(13), 2010, section 3): the rotation vector of the
tip is ``(-bend_y, bend_x, 0)``, so that a positive ``bend_x`` moves the tip towards +x of the base
and a positive ``bend_y`` towards +y.  The base frame has z along the straight instrument.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_SMALL = 1e-6


def tip_pose(bending: ArrayLike, length: float) -> tuple[Array, Array]:
    """Pose of the tip in the frame of the instrument's base.

    Parameters
    ----------
    bending
        ``bend_x`` and ``bend_y`` in rad, shape (2,); their norm is below pi.
    length
        Length of the bending section in m.

    Returns
    -------
    position : ndarray, shape (3,)
        In m.
    orientation : ndarray, shape (4,)
        Unit quaternion x, y, z, w with w > 0.

    Raises
    ------
    ValueError
        The section would bend by half a turn or more: orientation no longer tells the angles.
    """
    x, y = (float(v) for v in np.asarray(bending, dtype=float))
    angle = math.hypot(x, y)
    if not angle < math.pi:
        raise ValueError(f'a bending of {angle:.4g} rad is half a turn or more')
    if angle < _SMALL:
        lateral = 0.5 - angle * angle / 24.0
        along = 1.0 - angle * angle / 6.0
        half = 0.5 - angle * angle / 48.0
    else:
        lateral = (1.0 - math.cos(angle)) / (angle * angle)
        along = math.sin(angle) / angle
        half = math.sin(0.5 * angle) / angle
    position = np.array([lateral * x, lateral * y, along]) * length
    orientation = np.array([-half * y, half * x, 0.0, math.cos(0.5 * angle)])
    return position, orientation


def centre_line(bending: ArrayLike, length: float, points: int) -> Array:
    """Points of the section from its base to its tip, as many and as far apart along it.

    Parameters
    ----------
    bending
        ``bend_x`` and ``bend_y`` in rad, shape (2,).
    length
        Length of the bending section in m.
    points
        How many, N.

    Returns
    -------
    ndarray, shape (N, 3)
        In m, in the frame of the instrument's base.
    """
    x, y = (float(v) for v in np.asarray(bending, dtype=float))
    share = np.linspace(0.0, 1.0, points)
    angle = math.hypot(x, y) * share
    # The part up to a share of the length is bent by that share of the angles.
    lateral = 0.5 * share**2 * np.sinc(angle / (2.0 * math.pi)) ** 2
    along = share * np.sinc(angle / math.pi)
    return np.stack([lateral * x, lateral * y, along], axis=1) * length


def bending_from_orientation(orientation: ArrayLike) -> Array:
    """Bending angles that give the tip its orientation; the inverse of :func:`tip_pose`.

    A rotation about the instrument's own axis, which bending does not cause, is removed first
    (swing-twist decomposition with the twist at the base's z axis).

    Parameters
    ----------
    orientation
        Quaternion x, y, z, w relative to the straight instrument, shape (4,); any length but zero.

    Returns
    -------
    ndarray, shape (2,)
        ``bend_x`` and ``bend_y`` in rad.

    Raises
    ------
    ValueError
        The quaternion is zero or not finite, or the tip points straight back.
    """
    q = np.asarray(orientation, dtype=float)
    norm = float(np.linalg.norm(q))
    if not math.isfinite(norm) or norm == 0.0:
        raise ValueError(f'{q} is not an orientation')
    x, y, z, w = (float(v) for v in q / norm)
    twist = math.hypot(z, w)
    if twist < _SMALL:
        raise ValueError('the tip points straight back: the bending direction is undefined')
    # Swing = q * conj(twist): what is left once the turn about z is taken out.
    cz, cw = z / twist, w / twist
    sx = x * cw - y * cz
    sy = y * cw + x * cz
    sine = math.hypot(sx, sy)
    angle = 2.0 * math.atan2(sine, twist)
    factor = 2.0 if sine < _SMALL else angle / sine
    return np.array([factor * sy, -factor * sx])
