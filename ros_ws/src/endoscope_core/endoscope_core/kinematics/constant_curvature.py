"""Bending section of constant curvature about two axes: pose and velocity of the tip, vertebrae.

The section is an arc of fixed length whose plane and total angle are given by two bending angles
(Webster and Jones, Int. J. Robotics Research 29(13), 2010, section 3): the rotation vector of the
tip is ``(-bend_y, bend_x, 0)``, so that a positive ``bend_x`` moves the tip towards +x of the base
and a positive ``bend_y`` towards +y.  The base frame has z along the straight instrument.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_SMALL = 1e-6
VERTEBRAE = 12
"""Their number, which is even."""

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


def tip_pose(bending: ArrayLike, length: float) -> tuple[Array, Array]:
    """Position (3,) in m and orientation (4,) x, y, z, w of the tip in the frame of the base.

    `bending` (2,) is ``bend_x`` and ``bend_y`` in rad, `length` that of the section in m.
    ValueError if the section would bend by half a turn or more: orientation then leaves the angles
    open.
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


def tip_lever(bending: ArrayLike, length: float) -> float:
    """Way of the tip across its own axis for a radian of bending, m.

    The same in every direction: ``length (1 - cos(a)) / a**2``, bent (2,) by `a` rad in all.
    So a moment on a joint is the force across the tip times this lever (virtual work).
    """
    angle = math.hypot(*np.atleast_1d(np.asarray(bending, dtype=float)))
    return 0.5 * length * float(np.sinc(angle / (2.0 * math.pi))) ** 2


def centre_line(bending: ArrayLike, length: float, points: int) -> Array:
    """Points (N, 3) in m along a section of `length` m from base to tip, bent (2,) in rad."""
    x, y = (float(v) for v in np.asarray(bending, dtype=float))
    share = np.linspace(0.0, 1.0, points)
    angle = math.hypot(x, y) * share
    # The part up to a share of the length is bent by that share of the angles.
    lateral = 0.5 * share**2 * np.sinc(angle / (2.0 * math.pi)) ** 2
    along = share * np.sinc(angle / math.pi)
    return np.stack([lateral * x, lateral * y, along], axis=1) * length


def bending_from_orientation(orientation: ArrayLike) -> Array:
    """Bending angles (2,) in rad that give the tip its orientation; inverse of :func:`tip_pose`.

    `orientation` (4,) is a quaternion x, y, z, w relative to the straight instrument. ValueError if
    it is zero or not finite, or the tip points straight back.
    """
    q = np.asarray(orientation, dtype=float)
    norm = float(np.linalg.norm(q))
    if not math.isfinite(norm) or norm == 0.0:
        raise ValueError(f'{q} is not an orientation')
    x, y, z, w = (float(v) for v in q / norm)
    twist = math.hypot(z, w)
    if twist < _SMALL:
        raise ValueError('the tip points straight back: the bending direction is undefined')
    # A rotation about the instrument's own axis, which bending does not cause, is removed first
    # (swing-twist decomposition). Swing = q * conj(twist): what is left once the turn about z is
    # taken out.
    cz, cw = z / twist, w / twist
    sx = x * cw - y * cz
    sy = y * cw + x * cz
    sine = math.hypot(sx, sy)
    angle = 2.0 * math.atan2(sine, twist)
    factor = 2.0 if sine < _SMALL else angle / sine
    return np.array([factor * sy, -factor * sx])


class Hinge(NamedTuple):
    """What holds a link to the one before it, at a height in m."""

    name: str  # of the joint
    # Names of the links, which are those of their frames.
    parent: str
    child: str
    axis: str  # ``x`` or ``y``; empty for a link that is fixed to the one before it
    height: float  # where it is along the parent's z axis, in m


class Transform(NamedTuple):
    """Where a link is in the frame of the one before it, in m."""

    # Names of the frames.
    parent: str
    child: str
    translation: Vector  # in m, shape (3,)
    rotation: Quaternion  # unit quaternion x, y, z, w, shape (4,)


@dataclass(frozen=True)
class Vertebrae:
    """A bending section of vertebrae."""

    length: float  # of the bending section in m
    # Where it begins, z along the straight instrument.  The other frames are named after it:
    # ``endoscope_vertebra_01`` to ``endoscope_tip`` for ``endoscope_base``.
    base_frame: str

    @property
    def spacing(self) -> float:
        """Distance of two vertebrae in m."""
        return self.length / VERTEBRAE

    @property
    def tip_frame(self) -> str:
        """The frame at the end of the section."""
        return f'{self._stem}_tip'

    @property
    def _stem(self) -> str:
        return self.base_frame.removesuffix('_base')

    @cached_property
    def hinges(self) -> tuple[Hinge, ...]:
        """All joints from the base to the tip."""
        hinges = []
        parent, height = self.base_frame, 0.5 * self.spacing
        for k in range(1, VERTEBRAE + 1):
            name = f'vertebra_{k:02}'
            link = f'{self._stem}_{name}'
            first, second = 'xy' if k % 2 else 'yx'
            hinges += [
                Hinge(f'{name}_{first}', parent, f'{link}_hinge', first, height),
                Hinge(f'{name}_{second}', f'{link}_hinge', link, second, 0.0),
            ]
            parent, height = link, self.spacing
        return (*hinges, Hinge('tip', parent, self.tip_frame, '', 0.5 * self.spacing))

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the J joints that turn, from the base on."""
        return tuple(hinge.name for hinge in self.hinges if hinge.axis)

    def joint_angles(self, bending: Sequence[float]) -> tuple[float, ...]:
        """Angles (J,) in rad of all joints at ``bend_x`` and ``bend_y`` (2,) in rad.

        ValueError if the section would bend by half a turn or more.
        """
        # Real bending sections are rows of vertebrae with crossed hinges, and so is this one: each
        # turns about its x axis and its y axis, every second one the other way round. All x hinges
        # turn by the same angle and all y hinges by another one. Two vertebrae turn by
        # ``X(a) Y(2 b) X(a)``, whose axis has no share along the instrument, so that the tip has
        # exactly the orientation of `tip_pose`. Its place is that of a polygon of the arc's length:
        # with `d` rad in each vertebra it is too near to the base by ``(d/2)^2 / 3`` of their
        # distance, 0.35 % where both angles are at the shipped reach.
        x, y = bending
        angle = math.hypot(x, y)
        if not angle < math.pi:
            raise ValueError(f'a bending of {angle:.4g} rad is half a turn or more')
        half = angle / VERTEBRAE
        share = math.sin(half) / angle if angle else 1.0 / VERTEBRAE
        turn = {'x': math.atan2(-share * y, math.cos(half)), 'y': math.asin(share * x)}
        return tuple(turn[hinge.axis] for hinge in self.hinges if hinge.axis)

    def transforms(self, angles: Sequence[float]) -> list[Transform]:
        """Where every link is in the frame of the one before it, at joint angles (J,) in rad."""
        turns = iter(angles)
        found = []
        for _, parent, child, axis, height in self.hinges:
            half = 0.5 * next(turns) if axis else 0.0
            sine = math.sin(half)
            rotation = (
                sine if axis == 'x' else 0.0,
                sine if axis == 'y' else 0.0,
                0.0,
                math.cos(half),
            )
            found.append(Transform(parent, child, (0.0, 0.0, height), rotation))
        return found


class TipVelocity(NamedTuple):
    """Velocity of the tip in its own frame, z along the instrument: m/s and rad/s."""

    linear: Vector
    angular: Vector

    @property
    def ignored(self) -> str:
        """Say what two bending angles cannot follow, or what the angular velocity decides."""
        turns, moves = any(self.angular[:2]), any(self.linear[:2])
        parts = {
            'linear.z': self.linear[2],
            'angular.z': self.angular[2],
            'linear.x and linear.y beside angular.x and angular.y': turns and moves,
        }
        return ', '.join(part for part, asked in parts.items() if asked)


def bending_rate(
    velocity: TipVelocity, bending: Sequence[float], length: float
) -> tuple[float, float]:
    """Rates of ``bend_x`` and ``bend_y`` in rad/s by which the tip has a velocity across its axis.

    Its angular velocity decides; where that is zero, its linear one by the lever of a section of
    `length` m, bent (2,) in rad. ValueError if it is bent by half a turn or more: no rate turns the
    tip as asked there.
    """
    # The rotation vector r = (-bend_y, bend_x, 0) turns the tip, in its own frame, with J(r) dr/dt,
    # J being the right Jacobian of SO(3) (Sola, Deray and Atchuthan, A micro Lie theory,
    # arXiv:1812.01537, appendix B): across the axis dr/dt along r, and sin(a) / a of it across r.
    x, y = bending
    angle = math.hypot(x, y)
    if not angle < math.pi:
        raise ValueError(f'a bending of {angle:.4g} rad is half a turn or more')
    turn_x, turn_y = velocity.angular[1], -velocity.angular[0]
    if not (turn_x or turn_y):
        lever = tip_lever(bending, length)
        return velocity.linear[0] / lever, velocity.linear[1] / lever
    if angle < _SMALL:
        return turn_x, turn_y
    stretch = angle / math.sin(angle)
    radial = (1.0 - stretch) * (turn_x * x + turn_y * y) / angle**2
    return stretch * turn_x + radial * x, stretch * turn_y + radial * y
