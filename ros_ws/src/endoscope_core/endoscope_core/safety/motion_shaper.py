"""Bounds position, speed, acceleration and step of a motion, whatever is asked for.

Once its target has been reached, a motion within the bounds passes unchanged and undelayed, and so
does one that another shaper has already put at the bounds; any other becomes the nearest one that
keeps to the bounds.  It is trapezoidal in speed (Biagiotti and Melchiorri, Trajectory Planning for
Automatic Machines and Robots, 2008, section 3.2), found tick by tick from the target of now, for
nothing is known of the next one.

The bounds hold for every sequence of targets and periods because of one invariant, ``v**2 / (2 a)``
left to the end of the range: a joint that brakes with ``a`` from speed ``v`` in periods of any
length goes ``sum(v_k dt_k)``, a lower sum of the integral ``v**2 / (2 a)``.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

# rad: what sums of angles differ by. A motion that was shaped to these bounds stands on them but
# for this, and a second shaper that took it for too fast would brake it.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class MotionLimits:
    """What a motion of J joints keeps to, in rad and s.

    ValueError if a range is empty or a bound is not positive and finite.
    """

    # Range of positions in rad, shape (J,).
    low: tuple[float, ...]
    high: tuple[float, ...]
    speed: float  # rad/s
    acceleration: float  # rad/s^2: the speed changes by no more than this times the period
    step: float  # greatest change of position from one call to the next, in rad

    def __post_init__(self) -> None:
        for low, high in zip(self.low, self.high, strict=True):
            if not (math.isfinite(low) and math.isfinite(high) and low < high):
                raise ValueError(f'the range {low:g} to {high:g} rad is empty or not finite')
        for name in ('speed', 'acceleration', 'step'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f'{name} = {value} must be positive and finite')

    @classmethod
    def either_way(
        cls, joints: int, reach: float, speed: float, acceleration: float, step: float
    ) -> 'MotionLimits':
        """The same for every joint, up to `reach` in rad either way."""
        return cls((-reach,) * joints, (reach,) * joints, speed, acceleration, step)

    @property
    def longest_period(self) -> float:
        """Time in s in which the greatest speed makes the greatest step; more is a stall."""
        return self.step / self.speed


class MotionShaper:
    """Turns targets in rad into a motion within the limits.

    Call :meth:`shape` once for each accepted target with the time between the *stamps* of this one
    and the one before: by arrival, jitter would look like acceleration.

    A period longer than :attr:`MotionLimits.longest_period` is a stall: nothing was commanded
    meanwhile, so that the joint stands where it was sent last, and the motion starts from rest.
    """

    def __init__(self, limits: MotionLimits) -> None:
        self.limits = limits
        self.bounded = 0  # calls of `shape` whose target was not reached within the limits
        self._ranges = tuple(zip(limits.low, limits.high, strict=True))
        self.position: tuple[float, ...] = ()  # rad, (J,); empty before the first restart
        # rad/s over the last period, (J,).
        self.velocity: tuple[float, ...] = (0.0,) * len(self._ranges)
        self._target: tuple[float, ...] | None = None

    def restart(self, position: Sequence[float]) -> None:
        """Begin at rest where the joints are, in rad, shape (J,).

        A start beyond the range is taken as it is; from there the motion only leads back.

        ValueError if the position has another size or is not finite; nothing changes then.
        """
        self.position = self._checked('position', position)
        self.velocity = (0.0,) * len(self.position)
        self._target = None

    def shape(self, target: Sequence[float], period: float) -> tuple[float, ...]:
        """Next position (J,) in rad on the way to a target (J,), `period` s after the last call.

        RuntimeError if there was no :meth:`restart`, ValueError if the target has another size or
        is not finite, or the period is not positive; nothing changes then.
        """
        goals = self._checked('target', target)
        dt = self._begin_period(period)
        befores = self.position if self._target is None else self._target
        moves = [
            self._approach(*joint, dt)
            for joint in zip(
                goals, befores, self.position, self.velocity, self._ranges, strict=True
            )
        ]
        self.position, self.velocity = zip(*moves, strict=True)
        self._target = goals
        if self.position != goals:
            tolerance = 1e-6 * self.limits.step
            away = (abs(g - p) for g, p in zip(goals, self.position, strict=True))
            self.bounded += max(away) > tolerance
        return self.position

    def _begin_period(self, period: float) -> float:
        if not self.position:
            raise RuntimeError('the motion has no start: call restart first')
        if not (math.isfinite(period) and period > 0.0):
            raise ValueError(f'period = {period} s must be positive and finite')
        longest = self.limits.longest_period
        if period > longest:
            self.velocity = (0.0,) * len(self.velocity)
            self._target = None
            return longest
        return period

    def _approach(
        self,
        goal: float,
        before: float,
        position: float,
        velocity: float,
        ends: tuple[float, float],
        dt: float,
    ) -> tuple[float, float]:
        """Position and velocity of one joint after the period."""
        limits = self.limits
        low, high = ends
        change = limits.acceleration * dt
        rounding = _ROUNDING / dt
        left = before - position
        if abs(left) <= _ROUNDING and low <= goal <= high:
            # As in nearly every call: what keeps to the bounds passes.
            own = (goal - position) / dt
            room = _ROUNDING + (high - goal if own > 0.0 else goal - low)
            if (
                abs(own) <= limits.speed + rounding
                and abs(own - velocity) <= change + rounding
                and own * own <= 2.0 * limits.acceleration * room
            ):
                return goal, own
        own = (goal - before) / dt
        if abs(own) > limits.speed + rounding:
            own, left = 0.0, goal - position
        wanted = own + math.copysign(self._stoppable(abs(left), dt), left)
        wanted = min(wanted, limits.speed, self._stoppable(high - position, dt))
        wanted = max(wanted, -limits.speed, -self._stoppable(position - low, dt))
        wanted = min(velocity + change, max(velocity - change, wanted))
        moved = position + wanted * dt
        # Rounding alone may lead over the end of the range.
        return min(max(high, position), max(min(low, position), moved)), wanted

    def _stoppable(self, way: float, dt: float) -> float:
        """Greatest speed for this period from which braking after it ends within `way`, rad/s.

        The positive root of ``v dt + v**2 / (2 a) = way``.
        """
        if way <= 0.0:
            return 0.0
        a = self.limits.acceleration
        return 2.0 * way / (dt + math.sqrt(dt * dt + 2.0 * way / a))

    def _checked(self, name: str, values: Sequence[float]) -> tuple[float, ...]:
        numbers = tuple(map(float, values))
        if len(numbers) != len(self._ranges) or not all(map(math.isfinite, numbers)):
            raise ValueError(f'{name} must be {len(self._ranges)} finite numbers, not {numbers}')
        return numbers
