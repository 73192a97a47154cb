"""What a stream of commands says about the desired motion: quiet at rest, velocities believed late.

The laws multiply what they are given: their inverse is up to forty times steeper than the motion,
its branch hangs on the direction, and they look ahead by a lead times the velocity. Positions
therefore pass a play of one count of an encoder before any law sees them, and a velocity is taken
from a message only where the positions bear it out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from endoscope_core.control.limits import COUNT, Play, SmoothFollower

BANDWIDTH = 60.0
"""Of the velocity that is estimated from positions, in rad/s: that of a hand, see `handle`."""

LONGEST_LEAD = 0.06
AGREEMENT = COUNT / LONGEST_LEAD
"""By how much, in rad/s, a velocity may differ from the positions.

What is let through moves the angle that a law foresees, `LONGEST_LEAD` times the velocity ahead, by
one count at most; the laws' play takes up two.
"""

AGREEING = 3
"""So many messages in a row must agree before a velocity is used.

The velocity of a step of noise agrees with that step. Noise of one count either way spans two
counts and can therefore make two equal steps in a row, but not three.
"""


class _Joint:
    """One joint on its way."""

    def __init__(self, position: float, velocity: float | None) -> None:
        self.play = Play(COUNT, position)
        self.smooth = SmoothFollower(BANDWIDTH, position)
        self.position = position
        self.stated = velocity
        self.agreeing = 0

    def follow(self, position: float, velocity: float | None, dt: float) -> None:
        moved = position - self.position
        stated, self.stated = self.stated, velocity
        self.position = position
        quiet = self.play.follow(position)
        self.smooth.follow(quiet, dt)
        if velocity is None or stated is None:
            return
        mean = moved / dt
        agrees = max(abs(velocity - mean), abs(stated - mean)) <= AGREEMENT
        self.agreeing = self.agreeing + 1 if agrees else 0
        if self.agreeing >= AGREEING:
            # From where the estimate would be, had the motion always been as fast: the next message
            # may be one whose velocity is not used.
            self.smooth.position = quiet - 2.0 * velocity / BANDWIDTH
            self.smooth.velocity = velocity


class DesiredMotion:
    """Angles and velocities of J joints as the laws may have them.

    Angles are those of the messages but for a play of one count either way. A velocity is the
    message's where it and the one before agree with the way between their positions (`AGREEMENT`),
    for some messages in a row (`AGREEING`); elsewhere it is estimated from the positions, ``2 /
    BANDWIDTH`` = 33 ms late.
    """

    def __init__(self, joints: int) -> None:
        self._count = joints
        self._joints: list[_Joint] = []

    def restart(self) -> None:
        """Forget the stream: the next message begins a motion from rest."""
        self._joints = []

    def follow(
        self, position: Sequence[float], velocity: Sequence[float], dt: float
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Angles and velocities (J,), rad and rad/s, for a message `dt` s after the one before.

        `velocity` is empty where the message has none. ValueError if an input has another size or
        is not finite, or `dt` is not positive; nothing changes then.
        """
        stated: Sequence[float | None] = velocity if len(velocity) else [None] * self._count
        numbers = [*position, *velocity]
        if len(position) != self._count or len(stated) != self._count:
            raise ValueError(
                f'{len(position)} positions and {len(velocity)} velocities: '
                f'there are {self._count} joints'
            )
        if not (all(map(math.isfinite, numbers)) and math.isfinite(dt) and dt > 0.0):
            raise ValueError(f'positions, velocities and dt must be finite: {numbers}, dt = {dt} s')
        if not self._joints:
            self._joints = [_Joint(p, v) for p, v in zip(position, stated, strict=True)]
        else:
            for joint, p, v in zip(self._joints, position, stated, strict=True):
                joint.follow(p, v, dt)
        return (
            tuple([joint.play.value for joint in self._joints]),
            tuple([joint.smooth.velocity for joint in self._joints]),
        )
