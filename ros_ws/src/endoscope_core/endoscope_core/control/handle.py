"""What a handle says, at the graph's rate: smooth, quiet at rest, and referenced again."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from statistics import median_low

from endoscope_core.control.limits import COUNT, Play, SmoothFollower

_NS = 1e-9
_INTERVALS = 15
_KEPT = 256


class HandleRefusal(StrEnum):
    """Why a sample of the handle is not taken."""

    MALFORMED = 'malformed'
    NOT_FINITE = 'not finite'
    STAMP = 'stamp not increasing'
    JUMP = 'faster than a hand'


@dataclass(frozen=True)
class HandleSettings:
    """How a handle is read; angles in rad, times in s.

    ValueError if one of them is not positive and finite.
    """

    # Angle in rad of one count of its encoder. At rest a reading may dither by one count either
    # way without any motion of the slave.
    resolution: float = COUNT
    # Of the smoothing, in rad/s. 60 rad/s leaves half the power at 6 Hz: goal-directed motion of
    # an arm needs 5.6 Hz, that of a hand up to 9.2 Hz (Draper, IEEE Trans. Systems, Man, and
    # Cybernetics 24(6), 1994), physiological tremor lies at 8 to 12 Hz, and the servo of the
    # nominal plant is no faster either.
    bandwidth: float = 60.0
    timeout: float = 0.1  # silence in s after which the handle counts as gone
    # Greatest speed of a hand in rad/s. Turning it through 180 deg in 0.3 s, along the smoothest
    # path of that length, peaks at ``1.875 pi / 0.3 = 20 rad/s`` (Flash and Hogan 1985).
    top_speed: float = 20.0
    # By how much, in s, a sample may be received later than its stamp lets expect.
    jitter: float = 0.02

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f'{name} = {value} must be positive and finite')


class Handle:
    """Follows a handle of any rate from some 20 Hz upwards, while the clutch is held.

    Each sample passes a play of one count (:class:`Play`), so that a handle at rest stays at rest.
    Between samples the angle is interpolated over one interval of the handle, whose length is the
    median of the last ones, and smoothed (:class:`SmoothFollower`). The slave therefore follows the
    hand :attr:`lag` seconds late: one interval and ``2 / bandwidth``, 34 ms with a handle of 1 kHz
    and 53 ms with one of 50 Hz. Nothing is extrapolated: while a sample is late the hand counts as
    standing still.

    While engaged, ``slave = anchor + scale (handle - handle at engagement)`` within `low` and
    `high` (J,) in rad, the anchor being the slave's measured pose. A change of `scale` counts from
    the next engagement; ValueError if it is not positive and finite.
    """

    def __init__(
        self,
        low: Sequence[float],
        high: Sequence[float],
        scale: float = 1.0,
        settings: HandleSettings | None = None,
    ) -> None:
        self.scale = scale
        self.settings = settings or HandleSettings()
        self.refused = dict.fromkeys(HandleRefusal, 0)  # samples that were not taken
        self.last_reason = ''
        self._limits = tuple(zip(low, high, strict=True))
        self._timeout_ns = round(self.settings.timeout / _NS)
        self._jitter_ns = round(self.settings.jitter / _NS)
        self._engaged_scale = scale
        self._anchor: tuple[float, ...] | None = None
        self._reference: tuple[float, ...] = ()
        self._begin_anew()

    def _begin_anew(self) -> None:
        self._stamp_ns = 0
        self._raw: tuple[float, ...] = ()
        self._received_ns: int | None = None
        self._intervals: deque[int] = deque(maxlen=_INTERVALS)
        self._interval_ns = 0
        self._samples: deque[tuple[int, tuple[float, ...]]] = deque(maxlen=_KEPT)
        self._plays: list[Play] = []
        self._smooth: list[SmoothFollower] = []
        self._followed_ns = 0
        self._anchor = None

    @property
    def scale(self) -> float:
        """Motion of the slave for one radian of the handle's."""
        return self._scale

    @scale.setter
    def scale(self, value: float) -> None:
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f'scale = {value} must be positive and finite')
        self._scale = value

    @property
    def interval(self) -> float:
        """Usual time in s from sample to sample; 0 before the second one."""
        return self._interval_ns * _NS

    @property
    def lag(self) -> float:
        """By how much, in s, the slave follows a steady motion of the hand late."""
        return self.interval + 2.0 / self.settings.bandwidth

    @property
    def engaged(self) -> bool:
        """Whether the slave follows."""
        return self._anchor is not None

    def alive(self, now_ns: int) -> bool:
        """Whether a sample was taken within the time-out before local monotonic time `now_ns`."""
        return self._received_ns is not None and (now_ns - self._received_ns <= self._timeout_ns)

    def take(
        self, stamp_ns: int, position: Sequence[float], received_ns: int
    ) -> HandleRefusal | None:
        """Take a sample (J,) in rad, or say why it is refused and counted.

        `stamp_ns` is on the handle's own clock, which may have any offset; `received_ns` is local
        monotonic time.
        """
        if len(position) != len(self._limits):
            return self.refuse(HandleRefusal.MALFORMED, f'{len(position)} positions')
        if not all(map(math.isfinite, position)):
            return self.refuse(HandleRefusal.NOT_FINITE, f'{list(position)}')
        if not self.alive(received_ns):
            self._begin_anew()
            self._plays = [Play(self.settings.resolution, angle) for angle in position]
            self._smooth = [SmoothFollower(self.settings.bandwidth, angle) for angle in position]
            self._accept(stamp_ns, received_ns, received_ns, position)
            return None
        if stamp_ns <= self._stamp_ns:
            return self.refuse(HandleRefusal.STAMP, f'{stamp_ns} after {self._stamp_ns}')
        # The stamps say how far samples are apart, the receipt where they are in local time: a
        # stamp that lies can move a sample by no more than the jitter.
        before_ns = self._samples[-1][0]
        expected_ns = before_ns + stamp_ns - self._stamp_ns
        at_ns = min(received_ns, max(expected_ns, received_ns - self._jitter_ns))
        at_ns = max(at_ns, before_ns + 1)
        apart_ns = at_ns - before_ns
        farthest = self.settings.top_speed * max(apart_ns, self._interval_ns) * _NS
        farthest += 2.0 * self.settings.resolution
        for angle, last in zip(position, self._raw, strict=True):
            if abs(angle - last) > farthest:
                return self.refuse(HandleRefusal.JUMP, f'{abs(angle - last):.4g} rad')
        self._intervals.append(apart_ns)
        self._interval_ns = median_low(self._intervals)
        self._accept(stamp_ns, received_ns, at_ns, position)
        return None

    def _accept(
        self, stamp_ns: int, received_ns: int, at_ns: int, position: Sequence[float]
    ) -> None:
        self._stamp_ns = stamp_ns
        self._received_ns = received_ns
        self._raw = tuple(position)
        angles = tuple(
            play.follow(angle) for play, angle in zip(self._plays, position, strict=True)
        )
        self._samples.append((at_ns, angles))

    def refuse(self, refusal: HandleRefusal, words: str) -> HandleRefusal:
        """Count a sample that was found unusable elsewhere."""
        self.refused[refusal] += 1
        self.last_reason = f'{refusal}: {words}'
        return refusal

    def lose(self) -> None:
        """Take the handle for gone, whatever its time-out says, until it is heard again."""
        self._received_ns = None
        self.release()

    def engage(self, slave: Sequence[float]) -> None:
        """Begin to follow from the slave's measured pose (J,) in rad.

        What the hand did within the lag before is followed, too: a hand that moves while it engages
        is not stopped short. RuntimeError if no sample of the handle has been taken, ValueError if
        the pose has another size or is not finite.
        """
        if not self._smooth:
            raise RuntimeError('the handle has not been heard: nothing can be engaged')
        pose = tuple(float(angle) for angle in slave)
        if len(pose) != len(self._limits) or not all(map(math.isfinite, pose)):
            raise ValueError(f'slave must be {len(self._limits)} finite numbers, not {pose}')
        self._anchor = pose
        self._engaged_scale = self.scale
        self._reference = tuple(smooth.position for smooth in self._smooth)

    def release(self) -> None:
        """Stop following."""
        self._anchor = None

    def follow(self, now_ns: int) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
        """Position and velocity of the slave (J,), rad and rad/s, at a local monotonic time in ns.

        To be called at every tick, whether engaged or not; None while the slave does not follow. A
        handle that has been silent for longer than the time-out is released.
        """
        if not self.alive(now_ns):
            self.release()
            return None
        elapsed = (now_ns - self._followed_ns) * _NS if self._followed_ns else 0.0
        self._followed_ns = now_ns
        angles = self._interpolated(now_ns - self._interval_ns)
        for smooth, angle in zip(self._smooth, angles, strict=True):
            smooth.follow(angle, max(0.0, elapsed))
        if self._anchor is None:
            return None
        position, velocity = [], []
        for smooth, start, anchor, (low, high) in zip(
            self._smooth, self._reference, self._anchor, self._limits, strict=True
        ):
            free = anchor + self._engaged_scale * (smooth.position - start)
            inside = low < free < high
            position.append(min(high, max(low, free)))
            velocity.append(self._engaged_scale * smooth.velocity if inside else 0.0)
        return tuple(position), tuple(velocity)

    def _interpolated(self, at_ns: int) -> tuple[float, ...]:
        samples = self._samples
        while len(samples) > 1 and samples[1][0] <= at_ns:
            samples.popleft()
        first_ns, first = samples[0]
        if len(samples) == 1 or at_ns <= first_ns:
            return first
        second_ns, second = samples[1]
        share = (at_ns - first_ns) / (second_ns - first_ns)
        return tuple(a + share * (b - a) for a, b in zip(first, second, strict=True))
