"""On whose word a node moves the slave: its part in the motion sessions of the supervisor.

An ``enable`` opens a numbered motion session; the supervisor repeats its name at 20 Hz, and nothing
else makes a session.  Every command names the session that it belongs to.  A node takes part in a
session only if it was there when it was opened, and leaves it for good when the heartbeat ends,
when its own loop stands still, or when something that it needs is lost; it takes another `enable`
then.
"""

# The supervisor repeats the session's name every 50 ms.  Two lost beats and a late third one end
# the session, so that motors hold within 0.2 s of the supervisor's death.
HEARTBEAT_S = 0.05
SILENCE_NS = 150_000_000
# A loop that stood still for longer than commands live has neither heard nor watched anything.
STALL_NS = 100_000_000
# What a loop that came late did not hear is not a silence of the supervisor, up to this:
# a node that turns every 40 ms still leaves within 0.2 s.
_LENIENCE_NS = 40_000_000
_USUAL_TURN_NS = 40_000_000


class MotionSession:
    """One node's part in motion sessions.

    Every method takes the node's steady time in ns. The node calls :meth:`hear` at each heartbeat
    of the supervisor and :meth:`beat` at each turn of its own loop, and asks `name` before it moves
    anything. A supervisor that is silent for `SILENCE_NS` ends the session, and so does a loop that
    did not turn for `STALL_NS`.
    """

    def __init__(self) -> None:
        self.name = ''  # session that the node takes part in; empty: it must not move anything
        # Why the node takes no part in the open session; empty where it does or none is open.
        self.trouble = ''
        # None until the first heartbeat and after one in doubt: a session that is open by then was
        # not opened before our ears.
        self._open: str | None = None
        self._heard_ns = 0
        self._beat_ns: int | None = None
        self._lenience_ns = _LENIENCE_NS

    def hear(self, name: str, now_ns: int, doubt: str = '') -> bool:
        """Take a heartbeat; whether the node enters the session it names, at the measured pose.

        `name` is empty where none is open. `doubt` says why the heartbeat may not be the
        supervisor's, as with two senders on its topic, and ends the session.
        """
        if doubt:
            self.leave(doubt)
            self._open = None
            return False
        self._heard_ns = now_ns
        self._lenience_ns = _LENIENCE_NS
        before, self._open = self._open, name
        if name == before:
            return False
        if name and before is None:
            self.trouble = (
                self.trouble or f'was not there when {name} was opened: give enable again'
            )
            return False
        self.trouble = ''
        self.name = name
        return bool(name)

    def beat(self, now_ns: int) -> None:
        """Take a turn of the node's own loop, and notice what has ended the session."""
        before, self._beat_ns = self._beat_ns, now_ns
        if not self.name or before is None:
            return
        turn = now_ns - before
        if turn > STALL_NS:
            self.leave(f'stood still for {turn * 1e-6:.0f} ms')
            return
        if turn > _USUAL_TURN_NS:
            unheard = min(turn - _USUAL_TURN_NS, self._lenience_ns)
            self._lenience_ns -= unheard
            self._heard_ns += unheard
        if now_ns - self._heard_ns > SILENCE_NS:
            self.leave(f'the supervisor was silent for {(now_ns - self._heard_ns) * 1e-6:.0f} ms')

    def leave(self, reason: str) -> None:
        """End the node's part in the session; only another session lets it move again."""
        if self.name:
            self.trouble = f'left {self.name}: {reason}; give enable again'
            self.name = ''

    def belongs(self, session: str) -> bool:
        """Whether a message that names this session may move anything."""
        return bool(self.name) and session == self.name
