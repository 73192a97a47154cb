"""A slave moved by hand: when a dead-man lets it move, and the angles that it runs to."""

from collections.abc import Sequence

# A loop that stood still for longer has neither heard nor watched anything.
STALL_NS = 100_000_000

NEVER_HELD = 'not held yet'
LET_GO = 'let go'
SILENT = 'no sign of the operator'
STALLED = 'this program was not run in time'
"""Reasons of its own why a dead-man is not held."""
# So long ahead of what the master says that it wants the hand waits: it is at a limit.
_LEAD_S = 0.2
_LEAD_RAD = 0.002


class DeadMan:
    """Is held from a grip on, for as long as signs of that grip keep coming; all else lets go.

    Each time that the operator takes hold is a grip with a number of its own, larger than all
    before. A grip that has ended, or that was begun while something forbade it, never holds again,
    however many signs of it come: the operator has to let go and take hold again.

    Every time is steady and in ns. Call :meth:`hear` for each sign of the operator and :meth:`turn`
    at each turn of the loop.
    """

    def __init__(self) -> None:
        self.held = False
        self.reason = NEVER_HELD  # why it is not held; empty while it is
        self._grip = 0
        self._spent = 0
        self._until_ns = 0
        self._turned_ns: int | None = None

    def hear(self, now_ns: int, grip: int, lasts_ns: int) -> None:
        """Take a sign of a grip, 0 for a hand that let go; the next is due within `lasts_ns`."""
        if self.held and now_ns > self._until_ns:
            # Between two turns; whoever fell silent has ended his grip.
            self.let_go(SILENT)
        if grip != self._grip:
            self._spent = max(self._spent, self._grip)
        self._grip = grip
        self._until_ns = now_ns + lasts_ns

    def turn(self, now_ns: int, hindrance: str = '') -> bool:
        """Whether it is held now; `hindrance` says what forbids motion, empty for nothing."""
        late = self._turned_ns is not None and now_ns - self._turned_ns > STALL_NS
        self._turned_ns = now_ns
        if late:
            self.let_go(STALLED)
        elif self._grip <= self._spent:
            # No grip, or a late sign of one that has ended.
            self.let_go(LET_GO)
        elif now_ns > self._until_ns:
            self.let_go(SILENT)
        elif hindrance:
            self.let_go(hindrance)
        else:
            self.held, self.reason = True, ''
        return self.held

    def let_go(self, reason: str) -> None:
        """End the grip, whatever signs of it are still to come."""
        self._spent = max(self._spent, self._grip)
        self._grip = 0
        if self.held or reason != LET_GO:
            self.reason = reason
        self.held = False


class RunningAngles:
    """Angles that run while a grip holds, stay over its end, and do not wind up at a limit.

    What the master wants of the slave shows where a limit is, be it of the joint, of the tube or
    of the master's own: the angles wait there, and turn round at once.
    """

    def __init__(self, joints: int) -> None:
        self.position = [0.0] * joints  # rad, (J,)
        self._start: tuple[Sequence[float], Sequence[float]] | None = None

    def release(self) -> None:
        """End the grip."""
        self._start = None

    def run(
        self,
        speed: Sequence[float],
        usual: Sequence[float],
        elapsed: float,
        wanted: Sequence[float] | None,
        scale: float,
    ) -> tuple[bool, ...]:
        """Go on at `speed` (J,) in rad/s, and return which joints (J,) follow no further.

        `usual` (J,) is the greatest speed in rad/s for which the slave is given time to follow,
        `elapsed` the time in s since the last call of this grip, `scale` slave motion for one
        radian of the handle. `wanted` (J,) are the angles in rad that the master asks of the slave
        now; None while it follows nobody: the angles do not move before it does, nor away from what
        it has reached.
        """
        at_limit = [False] * len(self.position)
        if wanted is None:
            return tuple(at_limit)
        if self._start is None:
            self._start = tuple(self.position), tuple(wanted)
        begun, wanted_then = self._start
        for joint, v in enumerate(speed):
            way = (v > 0.0) - (v < 0.0)
            lead = scale * (self.position[joint] - begun[joint])
            lead -= wanted[joint] - wanted_then[joint]
            at_limit[joint] = bool(way) and way * lead > _LEAD_S * usual[joint] * scale + _LEAD_RAD
            if not at_limit[joint]:
                self.position[joint] += v * elapsed
        return tuple(at_limit)
