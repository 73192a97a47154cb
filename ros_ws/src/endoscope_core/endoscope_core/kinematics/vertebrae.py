"""The bending section as a chain of short rigid links, as viewers of robots draw it.

Real bending sections are rows of vertebrae with crossed hinges, and so is this one: each vertebra
turns about its x axis and its y axis, every second one the other way round.  All x hinges turn by
the same angle and all y hinges by another one, which is constant curvature.  Two vertebrae turn by
``X(a) Y(2 b) X(a)``, whose axis has no share along the instrument, so that the tip has exactly the
orientation of :func:`~endoscope_core.kinematics.constant_curvature.tip_pose`.  Its place is that
of a polygon of the arc's length: with ``d`` rad in each vertebra it is too near to the base by
``(d/2)^2 / 3`` of their distance, which is 0.35 % where both angles are at the shipped reach.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

VERTEBRAE = 12
"""Their number, which is even."""

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class Hinge(NamedTuple):
    """What holds a link to the one before it.

    Attributes
    ----------
    name
        Of the joint.
    parent, child
        Names of the links, which are those of their frames.
    axis
        ``x`` or ``y``; empty for a link that is fixed to the one before it.
    height
        Where it is along the parent's z axis, in m.
    """

    name: str
    parent: str
    child: str
    axis: str
    height: float


class Transform(NamedTuple):
    """Where a link is in the frame of the one before it.

    Attributes
    ----------
    parent, child
        Names of the frames.
    translation
        In m, shape (3,).
    rotation
        Unit quaternion x, y, z, w, shape (4,).
    """

    parent: str
    child: str
    translation: Vector
    rotation: Quaternion


@dataclass(frozen=True)
class Vertebrae:
    """A bending section of vertebrae.

    Attributes
    ----------
    length
        Of the bending section in m.
    base_frame
        Where it begins, z along the straight instrument.  The other frames are named after it:
        ``endoscope_vertebra_01`` to ``endoscope_tip`` for ``endoscope_base``.
    """

    length: float
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
        """Angles of all joints at a bending.

        Parameters
        ----------
        bending
            ``bend_x`` and ``bend_y`` in rad, shape (2,); their norm is below pi.

        Returns
        -------
        tuple of float
            In rad, shape (J,), in the order of `joint_names`.

        Raises
        ------
        ValueError
            The section would bend by half a turn or more.
        """
        x, y = bending
        angle = math.hypot(x, y)
        if not angle < math.pi:
            raise ValueError(f'a bending of {angle:.4g} rad is half a turn or more')
        half = angle / VERTEBRAE
        share = math.sin(half) / angle if angle else 1.0 / VERTEBRAE
        turn = {'x': math.atan2(-share * y, math.cos(half)), 'y': math.asin(share * x)}
        return tuple(turn[hinge.axis] for hinge in self.hinges if hinge.axis)

    def transforms(self, angles: Sequence[float]) -> list[Transform]:
        """Where every link is in the frame of the one before it.

        Parameters
        ----------
        angles
            Of the joints in rad, shape (J,), in the order of `joint_names`.
        """
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
