"""What the motor driver lets the shafts do: session, gate and shaper over one stream of goals."""

from collections.abc import Sequence

from endoscope_core.safety.command_gate import CommandGate, CommandLimits, Refusal
from endoscope_core.safety.motion_session import MotionSession
from endoscope_core.safety.motion_shaper import MotionLimits, MotionShaper

_NS = 1e-9
_FIRST_PERIOD_S = 1e-3


class ShaftMotion:
    """Gives the goal of the shafts (J,) in rad in every tick, whatever the commands are.

    The goal moves in three cases only: under commands of the session that the driver takes part in;
    to the position measured when those ended, within the bounds of the shaper; and, when a session
    begins, to the position measured then, which is where the shafts are.
    """

    def __init__(self, commands: CommandLimits, limits: MotionLimits) -> None:
        self.session = MotionSession()
        self.gate = CommandGate(commands)
        self.shaper = MotionShaper(limits)
        self.holds = 0  # how often commands have ended and the measured position was held
        self._entered = ''
        self._measured: tuple[float, ...] = ()
        self._held: tuple[float, ...] = ()
        self.goal: tuple[float, ...] = ()  # rad, (J,); empty before the first reading
        self._stamp_ns = 0

    @property
    def holding(self) -> bool:
        """Whether a measured position is held instead of commands followed."""
        return bool(self._held)

    def measure(self, position: Sequence[float]) -> None:
        """Take a reading of the shafts in rad, shape (J,)."""
        self._measured = tuple(position)
        if not self.goal:
            self._begin()

    def command(
        self,
        session: str,
        stamp_ns: int,
        position: Sequence[float],
        velocity: Sequence[float],
        now_ns: int,
        doubt: str = '',
    ) -> Refusal | None:
        """Take a command, or say why not.

        It names its `session`; `stamp_ns`, `position` and `velocity` are as in `CommandGate.check`,
        `now_ns` is local monotonic time. `doubt` says why it may not be the compensator's, as with
        two senders, and ends the session.
        """
        # After a standstill a command may come before the next tick does.
        self.session.beat(now_ns)
        self._notice_session()
        if not self.session.belongs(session):
            return self.gate.refuse(Refusal.SESSION, session or 'none named')
        if doubt:
            self.leave(doubt)
            return self.gate.refuse(Refusal.SENDER, doubt)
        if not self._measured:
            return self.gate.refuse(Refusal.STEP, 'no measured position yet')
        refusal = self.gate.check(stamp_ns, position, now_ns, self._measured, velocity)
        if refusal is not None:
            if refusal is Refusal.RATE:
                # It was not obeyed, but it came: the next one may not make up for its time.
                self._stamp_ns = max(self._stamp_ns, stamp_ns)
            return refusal
        period = max(0, stamp_ns - self._stamp_ns) * _NS
        self._stamp_ns = max(self._stamp_ns, stamp_ns)
        if self._held or self.gate.began:
            self._begin()
            # The clock of another stream may be behind that of the last one.
            self._stamp_ns = stamp_ns
            period = _FIRST_PERIOD_S
        self._held = ()
        if period > 0.0:
            self.goal = self.shaper.shape(position, period)
        return None

    def turn(self, now_ns: int, period: float) -> tuple[float, ...]:
        """Goal (J,) in rad, `period` s after the last; empty before the first reading."""
        self.session.beat(now_ns)
        self._notice_session()
        if not self.goal:
            return ()
        if not self._held and not self.gate.is_fresh(now_ns):
            # The goal has stood since the last command, which nothing may go on from at its speed.
            self.shaper.restart(self.goal)
            self.hold()
        if self._held:
            self.goal = self.shaper.shape(self._held, period)
        return self.goal

    def leave(self, reason: str) -> None:
        """End the driver's part in the session, and hold."""
        self.session.leave(reason)
        self._notice_session()

    def hold(self) -> None:
        """Go to where the shafts are now, and stay there."""
        if not self._held:
            self.holds += 1
        self._held = self._measured

    def _notice_session(self) -> None:
        if self.session.name == self._entered:
            return
        self._entered = self.session.name
        self.gate.reset()
        if not self.goal:
            return
        if self._entered:
            self._begin()
        else:
            self.hold()

    def _begin(self) -> None:
        """Start from rest where the shafts are."""
        self.shaper.restart(self._measured)
        self.goal = self._held = self._measured
