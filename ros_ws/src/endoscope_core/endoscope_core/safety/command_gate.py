"""Decides for each motion command whether it may be obeyed, and counts what it refuses."""

import math
import operator
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

_S_PER_NS = 1e-9
# A reader that comes late takes several commands at once: what a stream may save up for that.
_JITTER_S = 0.02
# So many times between stamps tell the usual one.
_GAPS = 50
# A stream of which more is refused than obeyed over the last second, for so long, moves nothing.
_TALLIED_NS = 1_000_000_000
_UNHEEDED_NS = 300_000_000


class Refusal(StrEnum):
    """Why a command is not obeyed."""

    SESSION = 'not of this motion session'
    SENDER = 'more than one sender'
    CLUTCH = 'clutch not held'
    MALFORMED = 'malformed'
    NOT_FINITE = 'not finite'
    STAMP = 'stamp not increasing'
    FUTURE = 'stamped in the future'
    LATE = 'late'
    RANGE = 'out of range'
    RATE = 'too fast'
    STEP = 'too far from the measured position'


@dataclass(frozen=True)
class CommandLimits:
    """What a command may ask of J joints, in rad and s."""

    reach: float  # largest position in rad, either way
    max_speed: float  # largest speed in rad/s
    # Largest distance in rad between the measured position and the first command of a stream.
    max_step: float
    # A command that reached us later than this is refused; a stream that pauses longer has ended.
    max_age_ns: int = 100_000_000


class CommandGate:
    """Obeys a stream of commands while it is complete, finite, in order, in time and in limits.

    Age is measured by the receiver's monotonic clock. The sender's clock may have any offset: the
    smallest difference between receipt and stamp in this stream is taken for it (with 0.1 % of the
    receiver's time for drift). A command that took longer than that by ``max_age_ns`` is late, and
    one that took so much less is stamped in the future. Where the first two commands of a stream do
    not agree, the first one's stamp is taken for the wrong one.

    Once nothing has come for longer than ``max_age_ns`` the next command begins another stream and
    tells its offset again: clocks drift, are set, and stand while a machine sleeps. Only a command
    that is late by the offset of the last stream is not believed, and what is refused is no pause:
    a stream that is late stays late until :meth:`reset`.

    Speed is judged by an allowance of travel, which grows by ``max_speed`` with the receiver's time
    and is spent by every command obeyed: stamps cannot stretch it, and it can be spent only once.
    """

    def __init__(self, limits: CommandLimits) -> None:
        self.limits = limits
        self._tally: deque[tuple[int, bool]] = deque()
        self._obeyed = 0
        self._outnumbered_ns: int | None = None
        self.refused: dict[Refusal, int] = dict.fromkeys(Refusal, 0)
        self.accepted = 0
        # Commands that the sender's stamps tell of, obeyed or lost on the way, in streams that were
        # obeyed: the time between their stamps by what is usual of it, a low quantile, for a
        # command that is lost makes it longer.
        self.due = 0.0
        self.began = True  # whether the last command obeyed was the first of a stream
        self.last_reason = ''  # the last refusal in words
        self._interval_ns = 0
        self._gaps: list[int] = []
        self._position: tuple[float, ...] = ()
        self._stamp_ns = 0
        self._offset_ns: int | None = None
        self._offset_at_ns = 0
        self._heard_ns: int | None = None
        self._received_ns: int | None = None
        self._allowance = 0.0
        # Whether only one command of the stream has been obeyed.
        self._alone = False

    def reset(self) -> None:
        """Forget the stream so far, as when a motion session begins; counts stay."""
        self._forget_stream()
        self.last_reason = ''

    def _forget_stream(self) -> None:
        self._tally.clear()
        self._obeyed = 0
        self._outnumbered_ns = None
        self._position = ()
        self._stamp_ns = 0
        self._offset_ns = None
        self._received_ns = None
        self._interval_ns = 0
        self._alone = False

    def refuse(self, refusal: Refusal, words: str = '') -> Refusal:
        """Count a refusal that was found elsewhere."""
        self.refused[refusal] += 1
        self.last_reason = f'{refusal}: {words}' if words else str(refusal)
        return refusal

    @property
    def unheeded(self) -> str:
        """Say that the stream is refused rather than obeyed; empty while it is not.

        It is once more than half of the commands judged in the last second were refused, and this
        has been so for 0.3 s: whoever sends them believes that he moves something.
        """
        newest, since = self._heard_ns, self._outnumbered_ns
        if newest is None or since is None or newest - since < _UNHEEDED_NS:
            return ''
        refused = len(self._tally) - self._obeyed
        of = f'{refused} of the last {len(self._tally)} commands'
        return f'{of} are refused, last: {self.last_reason}'

    def check(
        self,
        stamp_ns: int,
        position: Sequence[float],
        received_ns: int,
        measured: Sequence[float],
        velocity: Sequence[float] = (),
    ) -> Refusal | None:
        """Judge a command (J,) in rad and rad/s; why it is refused, or None if it is to be obeyed.

        `stamp_ns` is its header's, `received_ns` local monotonic time; `measured` (J,) in rad is
        what the first command of a stream is compared with. `velocity` may be empty.
        """
        longest = self.limits.max_age_ns
        paused = self._heard_ns is not None and received_ns - self._heard_ns > longest
        if paused and self._lateness(stamp_ns, received_ns) <= longest:
            self._forget_stream()
        self._heard_ns = received_ns
        refusal = self._judge(stamp_ns, position, received_ns, measured, velocity)
        self._count(refusal is None, received_ns)
        return refusal

    def _judge(
        self,
        stamp_ns: int,
        position: Sequence[float],
        received_ns: int,
        measured: Sequence[float],
        velocity: Sequence[float],
    ) -> Refusal | None:
        if len(position) != len(measured):
            return self.refuse(Refusal.MALFORMED, f'{len(position)} positions')
        for value in (*position, *velocity):
            if not math.isfinite(value):
                return self.refuse(Refusal.NOT_FINITE, str(value))
        if self._alone and self._disagrees(stamp_ns, received_ns):
            self._forget_stream()
        streaming = self.is_fresh(received_ns)
        refusal = self._check_range(position, self._position if streaming else measured)
        refusal = refusal or self._check_stamp(stamp_ns, received_ns)
        if refusal is not None:
            return refusal
        if streaming:
            refusal = self._check_speed(position, received_ns)
        else:
            refusal = self._check_entry(position, measured)
        if refusal is not None:
            return refusal
        gap_ns = stamp_ns - self._stamp_ns
        self.due += self._commands_in(gap_ns) if streaming else 1.0
        self.began = not streaming
        self._alone = self._received_ns is None
        self._position = tuple(position)
        self._stamp_ns = stamp_ns
        self._received_ns = received_ns
        self.accepted += 1
        return None

    def is_fresh(self, now_ns: int) -> bool:
        """Whether the last obeyed command still holds at local monotonic time ``now_ns``."""
        return self._received_ns is not None and (
            now_ns - self._received_ns <= self.limits.max_age_ns
        )

    def _count(self, obeyed: bool, received_ns: int) -> None:
        """Keep what became of the commands of the last second."""
        self._tally.append((received_ns, obeyed))
        self._obeyed += obeyed
        while received_ns - self._tally[0][0] > _TALLIED_NS:
            self._obeyed -= self._tally.popleft()[1]
        if 2 * self._obeyed >= len(self._tally):
            self._outnumbered_ns = None
        elif self._outnumbered_ns is None:
            self._outnumbered_ns = received_ns

    def _commands_in(self, gap_ns: int) -> float:
        self._gaps.append(gap_ns)
        if len(self._gaps) == _GAPS:
            self._interval_ns = sorted(self._gaps)[_GAPS // 5]
            self._gaps.clear()
        return gap_ns / self._interval_ns if self._interval_ns else 1.0

    def _check_range(self, position: Sequence[float], here: Sequence[float]) -> Refusal | None:
        """From beyond the reach, which a measured pose may be, there is a way back only."""
        reach = self.limits.reach
        if max(map(abs, position)) <= reach:
            return None
        for value, now in zip(position, here, strict=True):
            if abs(value) > max(reach, abs(now)):
                return self.refuse(Refusal.RANGE, f'{value:.4g} rad beyond {reach:.4g}')
        return None

    def _check_stamp(self, stamp_ns: int, received_ns: int) -> Refusal | None:
        tolerance = self.limits.max_age_ns
        late_ns = self._lateness(stamp_ns, received_ns)
        if self._offset_ns is not None:
            if stamp_ns <= self._stamp_ns:
                return self.refuse(Refusal.STAMP, f'{stamp_ns} after {self._stamp_ns}')
            if late_ns > tolerance:
                return self.refuse(Refusal.LATE, f'by {late_ns * 1e-6:.1f} ms')
            if late_ns < -tolerance:
                return self.refuse(Refusal.FUTURE, f'by {-late_ns * 1e-6:.1f} ms')
        self._offset_ns = received_ns - stamp_ns - max(0, late_ns)
        self._offset_at_ns = received_ns
        return None

    def _lateness(self, stamp_ns: int, received_ns: int) -> int:
        """By how much longer than the quickest so far the command took, in ns; 0 for the first."""
        if self._offset_ns is None:
            return 0
        drift = max(0, received_ns - self._offset_at_ns) // 1000
        return received_ns - stamp_ns - self._offset_ns - drift

    def _disagrees(self, stamp_ns: int, received_ns: int) -> bool:
        late_ns = self._lateness(stamp_ns, received_ns)
        return abs(late_ns) > self.limits.max_age_ns

    def _check_speed(self, position: Sequence[float], received_ns: int) -> Refusal | None:
        limits = self.limits
        elapsed = (received_ns - (self._received_ns or 0)) * _S_PER_NS
        allowance = self._allowance + limits.max_speed * elapsed
        travel = _distance(position, self._position)
        if travel > allowance:
            return self.refuse(
                Refusal.RATE, f'{travel:.4g} rad where {allowance:.4g} rad were allowed'
            )
        # What is saved up beyond the jitter of a reader would let a stream leap.
        self._allowance = min(allowance - travel, limits.max_speed * _JITTER_S)
        return None

    def _check_entry(self, position: Sequence[float], measured: Sequence[float]) -> Refusal | None:
        step = _distance(position, measured)
        if step > self.limits.max_step:
            return self.refuse(Refusal.STEP, f'{step:.4g} rad from where it is')
        self._allowance = self.limits.max_speed * _JITTER_S
        return None


def _distance(a: Sequence[float], b: Sequence[float]) -> float:
    return max(map(abs, map(operator.sub, a, b)))
