"""The dead-man of the one operator at a page: open, ready or engaged, and why."""

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum

from endoscope_console.teleop.frames import InputDevice, InputFrame
from endoscope_core import teleop as rule
from endoscope_core.choices import FOLLOW_THE_HANDLE
from endoscope_core.teleop import DeadMan

FRAME_SILENCE_NS = 100_000_000
"""After the last arrival of a frame a grip is over."""
LATE_NS = 100_000_000
"""A frame that took so much longer than the quickest is not obeyed."""
BLIND_NS = 300_000_000
"""Age of the last drawn picture from which the operator counts as blind."""
STATE_NS = 3_500_000_000
"""Silence of the supervisor after which its state is unknown; motors hold long before."""

# What a hand that rests on a stick may leave.
_REST = 0.1
# Clocks of two machines drift apart by less than one in so many.
_DRIFT = 1000


class DeadManState(StrEnum):
    """State of the dead-man."""

    OPEN = 'OPEN'
    READY = 'READY'
    ENGAGED = 'ENGAGED'


class Reason(StrEnum):
    """Why a grip has ended, or cannot begin."""

    RELEASED = 'released'
    SILENT = 'silent'
    LATE = 'late'
    ORDER = 'order'
    MALFORMED = 'malformed'
    FLOOD = 'flood'
    HIDDEN = 'hidden'
    UNFOCUSED = 'unfocused'
    CLOSED = 'closed'
    LOST = 'lost'
    UNPLUGGED = 'unplugged'
    STATE = 'state'
    CALIBRATION = 'calibration'
    SOURCE = 'source'
    BLIND = 'blind'
    STALLED = 'stalled'
    HANDS_ON = 'hands on'


_OF_THE_RULE = {
    rule.LET_GO: Reason.RELEASED,
    rule.SILENT: Reason.SILENT,
    rule.STALLED: Reason.STALLED,
}


@dataclass(frozen=True)
class Conditions:
    """What motion depends on besides the hand; times are steady."""

    holder: str = ''  # client that holds the lease; empty for nobody
    state_enabled: bool = False  # whether the operating state last heard is ``ENABLED``
    state_ns: int = 0  # when it was heard
    calibrating: bool = False  # whether a calibration or a way home has the slave
    source: str = ''  # of the commands of the master
    # Number of each of the last pictures and when it was made, newest last; a picture stands here
    # before it is sent.
    pictures: tuple[tuple[int, int], ...] = ()
    playing: bool = False  # whether the master plays a motion that needs the clutch held
    session: str = ''  # another one may have begun unseen between two words on the state


class _Sender:
    """What a client has sent so far: whether its frames come in order and in time."""

    def __init__(self) -> None:
        self._seq = -1
        self._quickest_ns: int | None = None
        self._at_ns = 0
        self.grip = 0
        self.number = 0

    def begin(self) -> None:
        """Judge by the next frame: while nothing was heard, a page's clock may have slept."""
        self._quickest_ns = None

    def fault(self, frame: InputFrame, now_ns: int) -> Reason | None:
        if frame.seq <= self._seq:
            return Reason.ORDER
        self._seq = frame.seq
        took_ns = now_ns - round(frame.t * 1e9)
        late_ns = 0
        if self._quickest_ns is not None:
            drift_ns = max(0, now_ns - self._at_ns) // _DRIFT
            late_ns = took_ns - self._quickest_ns - drift_ns
            if late_ns > LATE_NS:
                return Reason.LATE
        self._quickest_ns, self._at_ns = took_ns - max(0, late_ns), now_ns
        return None


class OperatorDeadMan:
    """Is engaged by a new grip of an operator who was ready, and by nothing else.

    ========  ==================================================================  ========
    from      event                                                               to
    ========  ==================================================================  ========
    OPEN      nothing forbids motion, and the hands have been off since it does   READY
    READY     something forbids motion                                            OPEN
    READY     a grip with a number greater than every one before                  ENGAGED
    ENGAGED   the hand lets go; a frame fails to come, or is late, out of order   OPEN
              or malformed; something forbids motion
    ========  ==================================================================  ========

    Built on :class:`DeadMan`: a grip that has ended, or was begun while something forbade it, never
    holds again, and a program that was not run in time has heard nothing.

    Every time is steady and in ns.  Call :meth:`hear` for each frame with the time of its arrival,
    and :meth:`turn` at each turn of the loop, which alone leads to READY and ENGAGED.
    """

    def __init__(self) -> None:
        self.state = DeadManState.OPEN
        # Why the last grip, or the operator's readiness, has ended; None while it is engaged.
        self.reason: Reason | None = None
        # What an operator who is not ready lacks first; None outside OPEN.
        self.missing: Reason | None = Reason.LOST
        self.frame: InputFrame | None = None  # newest of the operator; None before the first
        self.grips = 0  # greatest number of a grip so far, from which another page counts on
        self.counts: Counter[Reason] = Counter()  # what ended grips that were engaged
        self._dead_man = DeadMan()
        self._holder = ''
        self._senders: dict[str, _Sender] = {}
        self._numbers = 0
        self._hands_off = False
        self._of_grip = (0, 0, False)
        self._of_master = ('', False)
        self._of_session = ''

    @property
    def engaged(self) -> bool:
        """Whether the clutch is held."""
        return self.state is DeadManState.ENGAGED

    def hear(self, frame: InputFrame, now_ns: int, client: str) -> None:
        """Take a frame that arrived at `now_ns`; one of anybody but the operator means nothing."""
        if not client or client != self._holder:
            return
        sender = self._senders.setdefault(client, _Sender())
        fault = sender.fault(frame, now_ns)
        self._dead_man.hear(now_ns, self._number(sender, frame), FRAME_SILENCE_NS - 1)
        ended = fault
        if self.engaged:
            silent = None if self._dead_man.held else Reason.SILENT
            ended = silent or fault or self._ended_by(frame)
        if fault is not Reason.ORDER:
            self.frame = frame
        if ended is not None:
            self._open(ended)
        elif self.state is DeadManState.OPEN:
            rests = abs(frame.x) < _REST and abs(frame.y) < _REST
            self._hands_off = not frame.pressed and (self._hands_off or rests)

    def refuse(self, reason: Reason, client: str) -> None:
        """Take note of what a client sent instead of frames, or that it has lost the lease."""
        if client and client == self._holder:
            self._open(reason)

    def closed(self, client: str) -> None:
        """Take note that a client is gone."""
        self.refuse(Reason.CLOSED, client)
        self._senders.pop(client, None)

    def turn(self, now_ns: int, conditions: Conditions) -> None:
        """Judge by the conditions as they are after the last frame was heard."""
        if conditions.holder != self._holder:
            self._open(Reason.LOST)
            self._holder, self.frame = conditions.holder, None
            if self._holder in self._senders:
                self._senders[self._holder].begin()
        hindrance = self._hindrance(now_ns, conditions)
        if self.state is DeadManState.OPEN:
            self._dead_man.turn(now_ns, Reason.HANDS_ON)
            self.missing = hindrance or (None if self._hands_off else Reason.HANDS_ON)
            if self.missing is None:
                self.state = DeadManState.READY
        elif self._dead_man.turn(now_ns, hindrance or ''):
            if not self.engaged:
                self._engage(conditions)
        elif self.engaged:
            reason = self._dead_man.reason
            self._open(_OF_THE_RULE.get(reason) or Reason(reason))
        elif hindrance or self.frame is None or self.frame.pressed:
            self._open(hindrance or Reason.HANDS_ON)

    def _number(self, sender: _Sender, frame: InputFrame) -> int:
        """Number of a grip among those of all clients; 0 for none and for one that is not new."""
        if not frame.pressed:
            return 0
        if frame.grip > sender.grip:
            self._numbers += 1
            sender.grip, sender.number = frame.grip, self._numbers
            self.grips = max(self.grips, frame.grip)
        return sender.number if frame.grip == sender.grip else 0

    def _engage(self, conditions: Conditions) -> None:
        frame = self.frame
        assert frame is not None
        self.state, self.reason = DeadManState.ENGAGED, None
        self._of_grip = frame.grip, frame.source, frame.position_mode
        self._of_master = conditions.source, conditions.playing
        self._of_session = conditions.session

    def _open(self, reason: Reason) -> None:
        self._dead_man.let_go(reason)
        self._hands_off = False
        if self.state is not DeadManState.OPEN:
            if self.engaged:
                self.counts[reason] += 1
            self.state, self.reason, self.missing = DeadManState.OPEN, reason, Reason.HANDS_ON

    def _ended_by(self, frame: InputFrame) -> Reason | None:
        """Why a frame ends the grip that is engaged."""
        if not frame.visible:
            return Reason.HIDDEN
        if not frame.focused:
            return Reason.UNFOCUSED
        grip, source, position_mode = self._of_grip
        if not frame.pressed:
            gone = source == InputDevice.GAMEPAD != frame.source
            return Reason.UNPLUGGED if gone else Reason.RELEASED
        same = (frame.grip, frame.source, frame.position_mode) == (grip, source, position_mode)
        return None if same else Reason.RELEASED

    def _hindrance(self, now_ns: int, conditions: Conditions) -> Reason | None:
        """What forbids motion now, whatever the hand does."""
        frame = self.frame
        if not conditions.holder:
            return Reason.LOST
        if frame is None:
            return Reason.SILENT
        if not frame.visible:
            return Reason.HIDDEN
        if not frame.focused:
            return Reason.UNFOCUSED
        if not conditions.state_enabled or now_ns - conditions.state_ns > STATE_NS:
            return Reason.STATE
        if self.engaged and conditions.session != self._of_session:
            return Reason.STATE
        if conditions.calibrating:
            return Reason.CALIBRATION
        of_master = conditions.source, conditions.playing
        follows = conditions.source == FOLLOW_THE_HANDLE or conditions.playing
        if not follows or (self.engaged and of_master != self._of_master):
            return Reason.SOURCE
        if not _sees(frame.seen, now_ns, conditions.pictures):
            return Reason.BLIND
        return None


def _sees(seen: int, now_ns: int, pictures: tuple[tuple[int, int], ...]) -> bool:
    """Whether a picture is one of the last ones."""
    for number, made_ns in reversed(pictures):
        if now_ns - made_ns > BLIND_NS:
            return False
        if number == seen:
            return True
    return False
