"""Where a master has the slave go: by a motion, a handle, or velocities that are commanded."""

import operator
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

from endoscope_core.control.handle import Handle, HandleSettings
from endoscope_core.control.range_cut import RangeCut
from endoscope_core.control.velocity_stream import VelocityStream, bounded_speed
from endoscope_core.names import JOINTS
from endoscope_core.rig import Rig
from endoscope_core.safety import BendingRange, MotionLimits, MotionShaper
from endoscope_core.safety.motion_session import STALL_NS
from endoscope_core.signals.sampled_motion import SampledMotion, approach

Angles = tuple[float, ...]

_TICK_S = 1e-3
# A hand that rests on a handle moves it by less than half a degree.
_MOTION_RAD = 0.01


class Desired(NamedTuple):
    """Desired bending of J joints, in rad and rad/s."""

    position: Angles
    velocity: Angles


class MotionSource(ABC):
    """Says where the slave is to be, tick by tick, from a pose at which it is."""

    def __init__(self, limits: MotionLimits) -> None:
        self.shaper = MotionShaper(limits)

    def begin(self, pose: Angles) -> None:
        """Begin at a pose (J,) in rad."""
        self.shaper.restart(pose)

    @abstractmethod
    def follows(self, held: bool) -> bool:
        """Whether it moves the slave while the clutch is held, or not."""

    @abstractmethod
    def is_there(self, now_ns: int) -> bool:
        """Whether there is anything to begin with."""

    @abstractmethod
    def next(self, now_ns: int, periods: int) -> Desired:
        """Where the slave is to be now, `periods` ms after the last time."""


class PlayedMotion(MotionSource):
    """A motion, approached at up to `speed` rad/s, held at its end; with `hold` by the clutch."""

    def __init__(
        self, limits: MotionLimits, motion: SampledMotion, speed: float, hold: bool
    ) -> None:
        super().__init__(limits)
        self._motion, self._speed, self.hold = motion, speed, hold
        self._approach: SampledMotion | None = None
        self._approached = self._next = 0
        self._stay: Angles = ()

    def begin(self, pose: Angles) -> None:
        super().begin(pose)
        self._stay, self._approached = pose, 0
        target = self._motion.at(self._next, pose)[0]
        self._approach = approach(pose, target, self._speed, _TICK_S)

    def follows(self, held: bool) -> bool:
        return held or not self.hold

    def is_there(self, now_ns: int) -> bool:
        return True

    def next(self, now_ns: int, periods: int) -> Desired:
        if self._approach is not None and self._approached < len(self._approach):
            at = self._approach.at(self._approached, self._stay)
            self._approached += periods
        else:
            at = self._motion.at(self._next, self._stay)
            self._next += periods
        return Desired(*map(tuple, at))

    @property
    def finished(self) -> bool:
        """Whether it has been played to its end."""
        return self._next >= len(self._motion)

    @property
    def progress(self) -> float:
        """How much of it has been played, s."""
        return min(self._next, len(self._motion)) * _TICK_S

    @property
    def length(self) -> float:
        """How long it is, s."""
        return len(self._motion) * _TICK_S


class FollowedHandle(MotionSource):
    """A handle, from where the slave is whenever the clutch is engaged or the handle was silent."""

    def __init__(self, limits: MotionLimits, handle: Handle, scale: float) -> None:
        super().__init__(limits)
        self._handle, self._scale = handle, scale
        self.followed: Desired | None = None  # in this tick; None while it is not engaged

    def begin(self, pose: Angles) -> None:
        super().begin(pose)
        self._handle.scale = self._scale
        self._handle.engage(pose)
        self.followed = Desired(pose, (0.0,) * len(pose))

    def follows(self, held: bool) -> bool:
        return held

    def is_there(self, now_ns: int) -> bool:
        return self._handle.alive(now_ns)

    def next(self, now_ns: int, periods: int) -> Desired:
        position = self.shaper.position
        # A handle that was silent while the slave was commanded to stay is taken up from there.
        if self.followed is None and self.is_there(now_ns):
            self.begin(position)
        # While the handle is silent and the clutch still held, the slave is commanded to stay.
        return self.followed or Desired(position, (0.0,) * len(position))


class CommandedVelocity(MotionSource):
    """Velocities of another program with the clutch held, braked before the range ends."""

    def __init__(self, limits: MotionLimits, stream: VelocityStream, cut: RangeCut) -> None:
        super().__init__(limits)
        self._stream, self._cut = stream, cut
        self.ranges: tuple[BendingRange, ...] = ()  # of the tube, as far as they are known

    def follows(self, held: bool) -> bool:
        return held

    def is_there(self, now_ns: int) -> bool:
        return self._stream.is_fresh(now_ns)

    def next(self, now_ns: int, periods: int) -> Desired:
        limits, angles = self.shaper.limits, self.shaper.position
        asked, seconds = self._stream.rate(now_ns), periods * _TICK_S
        # After a stall it begins from rest, as the shaper does.
        before = self.shaper.velocity if seconds <= limits.longest_period else (0.0,) * len(asked)
        seconds = min(seconds, limits.longest_period)
        ends = list(zip(limits.low, limits.high, strict=True))
        if self.ranges:
            self._cut(self.ranges, _gone(angles, asked, seconds), asked)
            ends = [
                (r.keep(low, 0.0)[0], r.keep(high, 0.0)[0])
                for r, (low, high) in zip(self.ranges, ends, strict=True)
            ]
        speeds = tuple(
            bounded_speed(speed, was, (angle - low, high - angle), limits.acceleration, seconds)
            for speed, was, angle, (low, high) in zip(asked, before, angles, ends, strict=True)
        )
        return Desired(_gone(angles, speeds, seconds), speeds)


def _gone(angles: Angles, speeds: Angles, seconds: float) -> Angles:
    return tuple(angle + speed * seconds for angle, speed in zip(angles, speeds, strict=True))


class MasterMotion:
    """Desired bending of J joints by one source or none, from the measured pose on.

    It keeps to the rig and, as far as that is known, to the tube. Times are steady, in ns.
    """

    def __init__(self, rig: Rig, bending: Callable[[], Angles | None]) -> None:
        facts = rig.joints
        self._limits, self._hand_limits = (
            MotionLimits.either_way(
                len(JOINTS), facts.reach, speed, facts.acceleration, facts.entry_step
            )
            for speed in (facts.speed, facts.hand_speed)
        )
        self.handle = Handle(
            self._limits.low,
            self._limits.high,
            settings=HandleSettings(rig.handle.resolution, timeout=rig.timeouts.handle),
        )
        self.velocities = VelocityStream(
            len(JOINTS), facts.hand_speed, rig.instrument.section_length
        )
        self.source: MotionSource | None = None
        self.ranges: tuple[BendingRange, ...] = ()
        self.cut = RangeCut()
        self.moving = False
        self._entry, self._bending = facts.entry, bending
        # The compensator would take a stream for the last one going on, and for a jump: the
        # measured pose is not what was commanded. It hears a command at most `STALL_NS` late, or
        # leaves the session.
        self._apart_ns = rig.timeouts.command_ns + STALL_NS
        self._sent_ns: int | None = None
        self._handle_from: Angles = ()
        self._handle_moved = False

    def play(self, motion: SampledMotion, speed: float, hold: bool) -> None:
        """Play a motion from its beginning; see :class:`PlayedMotion`."""
        self._take(PlayedMotion(self._limits, motion, speed, hold))

    def follow(self, scale: float) -> None:
        """Follow the handle, `scale` rad of the slave for one of the handle's."""
        self._take(FollowedHandle(self._hand_limits, self.handle, scale))

    def obey_velocities(self) -> None:
        """Go as fast as another program commands; see :class:`CommandedVelocity`."""
        self._take(CommandedVelocity(self._hand_limits, self.velocities, self.cut))

    def leave(self) -> None:
        """Move the slave no more."""
        self._take(None)

    def _take(self, source: MotionSource | None) -> None:
        self.rest()
        self.source, self._handle_moved = source, False

    def rest(self) -> None:
        """Stop moving: whatever comes next begins at the measured pose."""
        self.moving = False
        self.handle.release()
        self.velocities.end()

    @property
    def where(self) -> Angles | None:
        """Bending (J,) in rad that is commanded or, at rest, measured; None where unknown."""
        return self.source.shaper.position if self.source and self.moving else self._bending()

    def velocities_ended(self, now_ns: int) -> bool:
        """Whether velocities have fallen silent that moved the slave, and it stands still."""
        source = self.source
        return (
            self.moving
            and isinstance(source, CommandedVelocity)
            and not source.is_there(now_ns)
            and not any(source.shaper.velocity)
        )

    def take_handle(self, stamp_ns: int, position: Angles, now_ns: int) -> None:
        """Take a sample of the handle (J,) in rad, and notice one that moves unfollowed."""
        refused = self.handle.take(stamp_ns, position, now_ns)
        if refused is not None or isinstance(self.source, FollowedHandle):
            return
        if len(self._handle_from) != len(position):
            self._handle_from = position
        moved = max(map(abs, map(operator.sub, position, self._handle_from)), default=0.0)
        if moved > _MOTION_RAD:
            self._handle_from, self._handle_moved = position, True

    def handle_moved(self) -> bool:
        """Whether somebody has moved a handle that nothing follows since this was last asked."""
        moved, self._handle_moved = self._handle_moved, False
        return moved

    def next(
        self, tick_ns: int, now_ns: int, periods: int, *, held: bool, free: bool
    ) -> Desired | None:
        """Where to be at a tick, `periods` ms after the last; None: nowhere, as if not `free`."""
        followed, source = self.handle.follow(tick_ns), self.source
        if source is None or not (free and source.follows(held)):
            if self.moving or self.velocities.is_fresh(now_ns):
                self.rest()
            return None
        if isinstance(source, FollowedHandle):
            source.followed = None if followed is None else Desired(*followed)
        if isinstance(source, CommandedVelocity):
            source.ranges = self.ranges
        if not (self.moving or self._begins(source, now_ns)):
            return None
        wanted = source.next(now_ns, periods)
        angle, velocity = self.cut(self.ranges, *wanted)
        shaped = source.shaper.shape(angle, periods * _TICK_S)
        as_asked = all(abs(a - b) < 1e-9 for a, b in zip(angle, shaped, strict=True))
        self._sent_ns = now_ns
        return Desired(shaped, velocity if as_asked else source.shaper.velocity)

    def _begins(self, source: MotionSource, now_ns: int) -> bool:
        """Begin a stream, but not before the compensator knows that the last one has ended."""
        soon = self._sent_ns is not None and now_ns - self._sent_ns <= self._apart_ns
        pose = None if soon or not source.is_there(now_ns) else self._bending()
        if pose is None:
            return False
        source.begin(self._entry(pose))
        self.moving = True
        return True
