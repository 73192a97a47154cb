"""Decides for each motion command whether it may be obeyed, and counts what it refuses."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

_NS = 1e-9
# How much longer than between their receipts the time between the stamps of two commands may be.
_JITTER_NS = 20_000_000


class Refusal(StrEnum):
    """Why a command is not obeyed."""

    NOT_ENABLED = 'not enabled'
    CLUTCH = 'clutch not held'
    MALFORMED = 'malformed'
    NOT_FINITE = 'not finite'
    STAMP = 'stamp not increasing'
    LATE = 'late'
    RANGE = 'out of range'
    RATE = 'too fast'
    STEP = 'too far from the held position'


@dataclass(frozen=True)
class CommandLimits:
    """What a command may ask of J joints.

    Attributes
    ----------
    low, high
        Allowed positions in rad, shape (J,).
    max_speed
        Largest speed between two commands in rad/s.
    max_step
        Largest distance in rad between the held position and the first command of a stream.
    max_age_ns
        A command that reached us later than this is refused; a stream that pauses longer is stale.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]
    max_speed: float
    max_step: float
    max_age_ns: int = 100_000_000


class CommandGate:
    """Obeys a stream of commands while it is complete, finite, in order, in time and in limits.

    Age is measured by the receiver's monotonic clock.  The sender's clock may have any offset:
    the smallest difference between receipt and stamp so far is taken for it (with 0.1 % of the
    receiver's time for drift), and a command that took longer than that by ``max_age_ns`` is late.

    Parameters
    ----------
    limits
        What may be asked.

    Attributes
    ----------
    refused
        Number of refused commands by reason.
    accepted
        Number of obeyed ones.
    last_reason
        The last refusal in words.
    """

    def __init__(self, limits: CommandLimits) -> None:
        self.limits = limits
        self.refused: dict[Refusal, int] = dict.fromkeys(Refusal, 0)
        self.accepted = 0
        self.last_reason = ''
        self._ranges = tuple(zip(limits.low, limits.high, strict=True))
        self._position: tuple[float, ...] = ()
        self._stamp_ns = 0
        self._offset_ns: int | None = None
        self._offset_at_ns = 0
        self._received_ns: int | None = None

    def reset(self) -> None:
        """Forget the stream so far, as when motion is enabled anew; counts stay."""
        self._position = ()
        self._stamp_ns = 0
        self._offset_ns = None
        self._received_ns = None

    def refuse(self, refusal: Refusal, words: str = '') -> Refusal:
        """Count a refusal that was found elsewhere."""
        self.refused[refusal] += 1
        self.last_reason = f'{refusal}: {words}' if words else str(refusal)
        return refusal

    def check(
        self,
        stamp_ns: int,
        position: Sequence[float],
        velocity: Sequence[float],
        received_ns: int,
        held: Sequence[float] | None = None,
    ) -> Refusal | None:
        """Judge one command.

        Parameters
        ----------
        stamp_ns
            Its header stamp in ns.
        position, velocity
            rad and rad/s, shape (J,); ``velocity`` may be empty.
        received_ns
            Local monotonic time of receipt in ns.
        held
            Position in rad that is held now, shape (J,); the first command of a stream is compared
            with it. By default the last command obeyed, and none after a reset.

        Returns
        -------
        Refusal or None
            Why it is refused, or None if it is to be obeyed.
        """
        if len(position) != len(self._ranges):
            return self.refuse(Refusal.MALFORMED, f'{len(position)} positions')
        for value in position:
            if not math.isfinite(value):
                return self.refuse(Refusal.NOT_FINITE, f'position {value}')
        for value in velocity:
            if not math.isfinite(value):
                return self.refuse(Refusal.NOT_FINITE, f'velocity {value}')
        if stamp_ns <= self._stamp_ns:
            return self.refuse(Refusal.STAMP, f'{stamp_ns} after {self._stamp_ns}')
        late_ns = self._lateness_ns(stamp_ns, received_ns)
        if late_ns > self.limits.max_age_ns:
            return self.refuse(Refusal.LATE, f'by {late_ns * 1e-6:.1f} ms')
        for value, (low, high) in zip(position, self._ranges, strict=True):
            if not low <= value <= high:
                return self.refuse(Refusal.RANGE, f'{value:.4g} outside {low:.4g} to {high:.4g}')
        streaming = self._received_ns is not None and (
            received_ns - self._received_ns <= self.limits.max_age_ns
        )
        if streaming:
            refusal = self._check_rate(stamp_ns, position, received_ns)
        else:
            refusal = self._check_step(position, self._position if held is None else held)
        if refusal is not None:
            return refusal
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

    def _lateness_ns(self, stamp_ns: int, received_ns: int) -> int:
        difference = received_ns - stamp_ns
        if self._offset_ns is None:
            self._offset_ns = difference
        else:
            drift = max(0, received_ns - self._offset_at_ns) // 1000
            self._offset_ns = min(self._offset_ns + drift, difference)
        self._offset_at_ns = received_ns
        return difference - self._offset_ns

    def _check_rate(
        self, stamp_ns: int, position: Sequence[float], received_ns: int
    ) -> Refusal | None:
        # The sender's stamps alone would let it jump as far as it likes to date a command ahead.
        waited_ns = received_ns - (self._received_ns or 0) + _JITTER_NS
        elapsed = min(stamp_ns - self._stamp_ns, waited_ns) * _NS
        for value, before in zip(position, self._position, strict=True):
            if abs(value - before) > self.limits.max_speed * elapsed:
                return self.refuse(Refusal.RATE, f'{abs(value - before) / elapsed:.4g} rad/s')
        return None

    def _check_step(self, position: Sequence[float], held: Sequence[float]) -> Refusal | None:
        # Nothing is held before the first command.
        for value, here in zip(position, held, strict=False):
            if abs(value - here) > self.limits.max_step:
                return self.refuse(Refusal.STEP, f'{abs(value - here):.4g} rad')
        return None
