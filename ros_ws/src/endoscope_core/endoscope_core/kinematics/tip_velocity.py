"""From a velocity of the tip to rates of the two bending angles.

The tip's rotation vector ``r = (-bend_y, bend_x, 0)`` turns it, in its own frame, with the angular
velocity ``J(r) dr/dt``, ``J`` being the right Jacobian of SO(3) (Sola, Deray and Atchuthan, A micro
Lie theory, arXiv:1812.01537, appendix B).  Across the axis that is ``dr/dt`` along ``r``, and
``sin(a) / a`` of it across ``r``, where ``a`` is the whole bending.  Across its axis the tip moves
by ``length (1 - cos(a)) / a**2`` times the rates, the same in every direction.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from endoscope_core.kinematics.constant_curvature import Vector, tip_lever

_SMALL = 1e-6


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
