"""A page, its operator's hand and the server's beat, in time that a test lets pass."""

from dataclasses import replace

from endoscope_console.teleop.frames import InputFrame
from endoscope_console.teleop.operator import Conditions, DeadManState, OperatorDeadMan

MS = 1_000_000
PICTURE_NS = 33 * MS
# The page's clock began when the page did.
BEGAN_NS = 700 * MS
NEUTRAL = InputFrame(
    pressed=False,
    turbo=False,
    visible=True,
    focused=True,
    position_mode=False,
    source=0,
    seq=0,
    grip=0,
    seen=0,
    t=0.0,
    x=0.0,
    y=0.0,
)


class Page:
    """Sends what the hand does; the server turns once in a millisecond."""

    def __init__(self):
        self.dead_man = OperatorDeadMan()
        self.now = 1000 * MS
        self.client = 'c1'
        self.hand = NEUTRAL
        self.draws = True
        self.pictures = ((1, self.now),)
        self.seen = 1
        self.state_age_ns = 0
        self.conditions = Conditions('c1', True, source='master')
        self.turn()

    def turn(self, times=1):
        for _ in range(times):
            self.now += MS
            seq, made = self.pictures[-1]
            if self.now - made >= PICTURE_NS:
                self.pictures = (*self.pictures[-14:], (seq + 1, self.now))
            if self.draws:
                self.seen = self.pictures[-1][0]
            self.conditions = replace(
                self.conditions, state_ns=self.now - self.state_age_ns, pictures=self.pictures
            )
            self.dead_man.turn(self.now, self.conditions)

    def learns(self, state_age_ns=None, **changes):
        """Have the server know something else of lease and graph."""
        self.state_age_ns = self.state_age_ns if state_age_ns is None else state_age_ns
        self.conditions = replace(self.conditions, **changes)

    def frame(self, late_ns=0, **changes):
        seq = self.hand.seq + 1
        self.hand = replace(self.hand, seq=seq)
        t = (self.now - late_ns - BEGAN_NS) * 1e-9
        return replace(self.hand, **{'seen': self.seen, 't': t} | changes)

    def send(self, late_ns=0, **changes):
        frame = self.frame(late_ns, **changes)
        self.dead_man.hear(frame, self.now, self.client)
        return frame

    def go_on(self, ms, **changes):
        """Send 50 frames a second."""
        for k in range(ms):
            if k % 20 == 0:
                self.send(**changes)
            self.turn()

    def let_go(self, **changes):
        """Let go; hands that are off are seen to be by the frame after the one that says so."""
        self.hand = replace(self.hand, pressed=False, **changes)
        for _ in range(2):
            self.send()
            self.turn()

    def take_hold(self, **changes):
        self.hand = replace(self.hand, pressed=True, grip=self.hand.grip + 1, **changes)
        self.send()
        self.turn()

    def engage(self, **changes):
        self.let_go(**changes)
        assert self.dead_man.state is DeadManState.READY
        self.take_hold()
        assert self.dead_man.engaged
