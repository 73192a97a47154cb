"""Laws and parameters that several effects share."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Parameter
from endoscope_core.physics.layout import HISTORY

ONE_CELL = Parameter(
    'wire',
    '-',
    0.0,
    1.0,
    0.0,
    choices=(0.0, 1.0),
    words=('the cell of the positive wire', 'the cell of the negative wire'),
)
"""The cell of one wire."""
ONSETS = tuple(0.75 * k for k in range(1, 54))
"""Times in s where fits of what begins start: between one motion and the next, a wrong one leads
nowhere."""


@compiled
def share_after(onset: float, duration: float, smooth: float, time: float, tick: float) -> float:
    """Share in [0, 1] that has begun, in the mean over the tick around `time`; all in s.

    It rises for `duration` around `onset`: evenly, or along a half cosine if `smooth` is 1.
    """
    # Samples come once a tick: a step that takes as long shows in their sum wherever it lies.
    share = min(1.0, max(0.0, 0.5 + (time - onset) / (tick + duration)))
    return share if smooth == 0.0 else 0.5 - 0.5 * math.cos(math.pi * share)


@compiled
def value_before(ring: Array, ticks: float, delay: float, tick: float) -> float:
    """Value that a ring (HISTORY,) held `delay` s before tick `ticks`, interpolated."""
    # The ring reaches back to before the start, where everything was at rest.
    # Without the cut a tick longer than usual would reach beyond what the ring still holds.
    back = min(delay / tick, HISTORY - 2.0)
    whole = int(back)
    newer = ring[(int(ticks) - whole) % HISTORY]
    older = ring[(int(ticks) - whole - 1) % HISTORY]
    # A value held between ticks is, in the mean over a delayed tick, that same interpolation.
    return newer + (back - whole) * (older - newer)


@compiled
def play(follower: float, leader: float, half_gap: float) -> float:
    """Play operator: where a follower at `follower` is after its leader has moved to `leader`."""
    return min(leader + half_gap, max(leader - half_gap, follower))


@compiled
def push_back(
    depth: float, inwards: float, stiffness: float, exponent: float, loss: float
) -> tuple[float, float, float]:
    """Moment in N m at a depth > 0 in rad, and its slopes by depth and by speed inwards in rad/s.

    `stiffness` in N m/rad^exponent, `loss` in s/rad.
    """
    # stiffness depth^exponent (1 + loss inwards), and never a pull: Hunt, Crossley, J. Appl. Mech.
    # 42, 1975.
    braked = 1.0 + loss * inwards
    if braked <= 0.0:
        return 0.0, 0.0, 0.0
    elastic = stiffness * depth**exponent
    return elastic * braked, exponent * elastic / depth * braked, elastic * loss
