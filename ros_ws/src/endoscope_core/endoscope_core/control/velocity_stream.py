"""Velocities of bending that another program commands: which are obeyed, and for how long."""

import math
from collections.abc import Sequence

from endoscope_core.kinematics import TipVelocity, bending_rate
from endoscope_core.safety import CommandGate, CommandLimits, Refusal

WATCHDOG_NS = 150_000_000
"""Silence after which the velocity is zero, ns."""
# The shaper bounds how a velocity changes.
_ANY_CHANGE = 1e9


def bounded_speed(
    asked: float, before: float, ways: tuple[float, float], acceleration: float, seconds: float
) -> float:
    """Speed in rad/s nearest to the one that is asked for, `seconds` after the speed `before`.

    It changes by no more than the acceleration in rad/s^2 lets it, and it can be braked within the
    `ways` in rad that are left to the lower and to the upper end of the range.
    """
    change = acceleration * seconds
    speed = min(before + change, max(before - change, asked))
    down, up = (_stoppable(way, acceleration, seconds) for way in ways)
    return max(-down, min(up, speed))


def _stoppable(way: float, acceleration: float, seconds: float) -> float:
    # As in the motion shaper: the positive root of ``v dt + v**2 / (2 a) = way``.
    root = math.sqrt(seconds**2 + 2.0 * max(0.0, way) / acceleration)
    return 2.0 * max(0.0, way) / (seconds + root)


class VelocityStream:
    """Obeys velocities of J joints while they are finite, in order, in time and not too fast.

    They pass the gate of commands (:class:`CommandGate`), with the watchdog for its longest age and
    `speed` in rad/s for the reach. Times are local and monotonic, in ns, but for stamps.
    """

    def __init__(self, joints: int, speed: float, section_length: float) -> None:
        self.gate = CommandGate(CommandLimits(speed, _ANY_CHANGE, _ANY_CHANGE, WATCHDOG_NS))
        self.ignored = ''  # what the last velocity of the tip asked for beyond two bending angles
        self._rest = (0.0,) * joints
        self._rate, self._lost = self._rest, False
        self._speed, self._length = speed, section_length

    def take(self, stamp_ns: int, rate: Sequence[float], now_ns: int) -> Refusal | None:
        """Take velocities (J,) in rad/s; why they are refused, or None."""
        refusal = self.gate.check(stamp_ns, rate, now_ns, self._rest)
        if refusal is Refusal.RANGE:
            fastest = max(map(abs, rate))
            self.gate.last_reason = f'{refusal}: {fastest:.4g} rad/s beyond {self._speed:.4g}'
        if refusal is None:
            self._rate, self._lost, self.ignored = tuple(rate), False, ''
        return refusal

    def take_tip(
        self, stamp_ns: int, velocity: TipVelocity, now_ns: int, bending: Sequence[float] | None
    ) -> Refusal | None:
        """Take a velocity of the tip, bent (2,) in rad as far as that is known; as :meth:`take`."""
        if bending is None:
            return self.gate.refuse(Refusal.STEP, 'no measured position')
        if not all(map(math.isfinite, (*velocity.linear, *velocity.angular))):
            return self.gate.refuse(Refusal.NOT_FINITE, f'{velocity.linear}, {velocity.angular}')
        try:
            rate = bending_rate(velocity, bending, self._length)
        except ValueError as error:
            return self.gate.refuse(Refusal.RANGE, str(error))
        refusal = self.take(stamp_ns, rate, now_ns)
        if refusal is None:
            self.ignored = velocity.ignored
        return refusal

    def is_fresh(self, now_ns: int) -> bool:
        """Whether a velocity holds."""
        return self.gate.is_fresh(now_ns) and not self._lost

    def rate(self, now_ns: int) -> tuple[float, ...]:
        """Velocities (J,) in rad/s that are wanted now: zero once the watchdog has expired."""
        return self._rate if self.is_fresh(now_ns) else self._rest

    def lose(self) -> None:
        """Take the stream for silent, whatever its watchdog says, until it is heard again."""
        self._lost = True

    def end(self) -> None:
        """Forget the stream, as when a session ends or the clutch is released; counts stay."""
        self.gate.reset()
        self.ignored = ''
