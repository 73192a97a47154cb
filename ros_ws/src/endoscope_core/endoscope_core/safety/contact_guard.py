"""Guard of the force at the tip: what pushes too hard is approached slowly, and left freely."""

import math
from collections.abc import Callable, Sequence
from enum import StrEnum
from typing import NamedTuple

SILENT_NS = 350_000_000
"""Age of an estimate from which nothing is known: an estimate is 0.1 s late, and ten of them, 40 a
second, are missed."""
_SAME = 1e-9
CERTAIN = 2
"""Estimates in a row that have to push too hard. An alarm waits for eight, by which a hand has gone
on; a false contact costs a moment at contact speed."""


class GuardState(StrEnum):
    """Whether a guard can judge, and whether it acts."""

    OFF = 'off'  # nothing is known
    WATCHING = 'watching'
    YIELDING = 'yielding'


class FeltForce(NamedTuple):
    """Force on the tip along J joints in N, positive where it pushes towards a positive angle.

    `low` and `high` are its bounds; NaN where nothing is known of a joint.
    """

    time_ns: int  # monotonic, of the samples that it is from
    force: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]


class _Side:
    """One direction of a joint."""

    def __init__(self, sign: float) -> None:
        self.sign = sign
        self.yielding = False
        self.deepest = -math.inf  # furthest target that was followed as far as it may be, rad

    def begin(self, target: float) -> None:
        if not self.yielding:
            self.yielding, self.deepest = True, self.sign * target

    def move(self, before: float, target: float, most: float, pressed: bool) -> float:
        """Next angle, at most `most` rad from the one before; pressed, only as the target goes."""
        depth, moved = self.sign * target, self.sign * (target - before)
        allowed = min(most, max(0.0, depth - self.deepest)) if pressed else most
        behind = moved > allowed
        self.deepest = max(self.deepest, depth) if behind else depth
        # Rounding alone may lead beyond the target.
        return self.sign * min(depth, self.sign * before + allowed) if behind else target


class _Joint:
    """A joint: the newest force that shows something, and what follows from it."""

    def __init__(self) -> None:
        self.sides = _Side(1.0), _Side(-1.0)
        self.force = 0.0
        self.known_ns: int | None = None
        self.pushed = 0.0  # sign of the motion against a force that is certain
        self.towards = 0.0  # and against one above the limit
        self._pressed = 0  # estimates in a row that are certain of that
        self._last = (0.0, 0.0, 0.0)  # of them, force and bounds in N

    @property
    def yielding(self) -> bool:
        return self.sides[0].yielding or self.sides[1].yielding

    def is_known(self, now_ns: int) -> bool:
        return self.known_ns is not None and now_ns - self.known_ns <= SILENT_NS

    def is_eased(self, side: _Side, now_ns: int) -> bool:
        """Whether the force on a side is known to be no more than the limit."""
        return self.is_known(now_ns) and self.towards != side.sign

    def is_released(self, side: _Side, now_ns: int) -> bool:
        """Whether in addition nothing may push there."""
        return self.is_eased(side, now_ns) and self.pushed != side.sign

    def feel(self, felt: FeltForce, j: int, limit: float, target: float) -> None:
        force, low, high = felt.force[j], felt.low[j], felt.high[j]
        pressed, self._pressed = self._pressed, 0
        if not (math.isfinite(force) and low <= high):
            return
        certain = low > 0.0 or high < 0.0
        if not certain and 0.5 * (high - low) > limit:
            return  # a force at the limit would be hidden
        before = self.towards if self.is_known(felt.time_ns) else 0.0
        # At rest an estimate is the last one again, by a lever that is measured anew.
        last, self._last = self._last, (force, low, high)
        again = all(
            math.isclose(now * last[0], then * force, rel_tol=_SAME)
            for now, then in zip(self._last, last, strict=True)
        )
        self.known_ns, self.force = felt.time_ns, force
        self.pushed = -math.copysign(1.0, force) if certain else 0.0
        self.towards = -math.copysign(1.0, force) if abs(force) > limit else 0.0
        if certain and self.towards:
            self._pressed = pressed + (not again) if self.towards == before else 1
        if self._pressed >= CERTAIN:
            for side in self.sides:
                if side.sign == self.towards:
                    side.begin(target)


class ContactGuard:
    """Slows a motion of J joints against a force above a limit; it never moves by itself.

    A joint yields from `CERTAIN` estimates in a row above `limit` in N whose bounds exclude that
    nothing pushes. As long as it does, motion with the force passes. Against it the joint follows
    at no more than `speed` in m/s of the tip, above the limit only while the target moves on, below
    it until it is there; where the bounds have nothing push any more, at no more than `release`. It
    ends once the force is below the limit and the target no longer ahead, so that the slave does
    not leap when an obstacle gives way; without any estimate, once the target is back behind what
    was sent. Otherwise all passes unchanged. Times are monotonic, in ns.

    `lever` gives the way of the tip in m for a radian at angles (J,) in rad.
    """

    def __init__(
        self,
        names: Sequence[str],
        limit: float,
        speed: float,
        release: float,
        lever: Callable[[Sequence[float]], float],
    ) -> None:
        self._names, self.limit, self.speed, self.release = tuple(names), limit, speed, release
        self._lever = lever
        self._joints = [_Joint() for _ in names]
        self._sent: tuple[float, ...] = ()  # rad; empty while nothing is commanded
        self._asked: tuple[float, ...] = (0.0,) * len(self._names)
        self._now_ns = self._felt_ns = 0

    def feel(self, felt: FeltForce) -> None:
        """Take an estimate of the force, unless it is silent already or there is a newer one."""
        if felt.time_ns < max(self._felt_ns, self._now_ns - SILENT_NS):
            return
        self._felt_ns = felt.time_ns
        for j, joint in enumerate(self._joints):
            joint.feel(felt, j, self.limit, self._asked[j])

    def begin(self, angle: Sequence[float], now_ns: int) -> None:
        """A stream of commands begins at angles (J,) in rad."""
        self.end()
        self.look(now_ns)
        self._sent = self._asked = tuple(angle)
        for joint, q in zip(self._joints, angle, strict=True):
            for side in joint.sides:
                side.deepest = side.sign * q

    def end(self) -> None:
        """The stream has ended: nothing is left to be caught up with."""
        self._sent = ()
        self.look(self._now_ns)

    def look(self, now_ns: int) -> None:
        """Notice that time has passed."""
        self._now_ns = now_ns
        if self._sent:
            return
        for joint in self._joints:
            for side in joint.sides:
                side.yielding &= joint.towards == side.sign and joint.is_known(now_ns)

    def __call__(
        self, angle: Sequence[float], velocity: Sequence[float], seconds: float, now_ns: int
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Angles (J,) in rad and velocities in rad/s (or none) to go on with.

        `seconds` since the call before. RuntimeError if no stream has begun.
        """
        if not self._sent:
            raise RuntimeError('the stream has no start: call begin first')
        self._now_ns, asked, speeds = now_ns, tuple(angle), tuple(velocity)
        sent = asked
        if any(joint.yielding for joint in self._joints):
            # The tip goes on by no more, however many joints do.
            many = math.sqrt(sum(joint.yielding for joint in self._joints))
            way = seconds / (self._lever(self._sent) * many)
            sent = tuple(map(self._kept, self._joints, self._sent, asked, [way] * len(asked)))
            if speeds:
                moved = zip(sent, asked, self._sent, speeds, strict=True)
                speeds = tuple(v if q == a else (q - b) / seconds for q, a, b, v in moved)
        self._sent, self._asked = sent, asked
        return sent, speeds

    def _kept(self, joint: _Joint, before: float, target: float, way: float) -> float:
        """Next angle of a joint; `way` in rad is that of a tip at 1 m/s."""
        known, kept = joint.is_known(self._now_ns), target
        for side in joint.sides:
            moved = side.sign * (target - before)
            if not side.yielding:
                continue
            eased = joint.is_eased(side, self._now_ns)
            if moved >= 0.0:
                released = joint.is_released(side, self._now_ns)
                most = way * (self.release if released else self.speed)
                kept = side.move(before, target, most, not eased)
            else:
                side.deepest = side.sign * target
            ahead = side.sign * (target - kept) > 0.0
            side.yielding = ahead or not (eased or (not known and moved < 0.0))
        return kept

    @property
    def state(self) -> GuardState:
        """Whether it can judge, and whether it acts on a stream of commands."""
        if self._sent and any(joint.yielding for joint in self._joints):
            return GuardState.YIELDING
        known = any(joint.is_known(self._now_ns) for joint in self._joints)
        return GuardState.WATCHING if known else GuardState.OFF

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that yield or, where none does, of those that are watched."""
        acts = self.state is GuardState.YIELDING
        return tuple(
            name
            for name, joint in zip(self._names, self._joints, strict=True)
            if (joint.yielding if acts else joint.is_known(self._now_ns))
        )

    @property
    def reason(self) -> str:
        """Why nothing is known, in words; empty where something is."""
        if any(joint.is_known(self._now_ns) for joint in self._joints):
            return ''
        if not self._felt_ns:
            return 'no force is known'
        if self._now_ns - self._felt_ns > SILENT_NS:
            return 'the force is silent'
        return 'its bounds are wider than the limit'

    def in_words(self) -> str:
        """State as a sentence without its stop."""
        state, reason = self.state, self.reason
        if state is not GuardState.YIELDING:
            return f'{state}: {reason}' if reason else str(state)
        pushes, released = list[str](), list[str]()
        for name, joint in zip(self._names, self._joints, strict=True):
            sides = [side for side in joint.sides if side.yielding]
            if sides and all(joint.is_released(side, self._now_ns) for side in sides):
                released.append(name)
            elif sides:
                verb = 'pushed' if reason else 'pushes'
                pushes.append(f'{name} {verb} with {abs(joint.force):.2f} N')
        parts = []
        if pushes:
            parts.append(
                f'{" and ".join(pushes)} (limit {self.limit:.2f} N): '
                f'towards the contact only at {self.speed * 1e3:g} mm/s'
            )
        if released:
            parts.append(
                f'nothing pushes {" and ".join(released)} any more: '
                f'follows the hand at {self.release * 1e3:g} mm/s'
            )
        if reason:
            parts.append(f'now {reason}')
        return f'{state}: {"; ".join(parts)}'
