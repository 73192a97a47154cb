"""A handle that is made of keys: events and time in, angles and clutch out."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from endoscope_bringup.teleop.terminal import FOCUS_LOST, KeyEvent, KeyEventKind
from endoscope_core.teleop import DeadMan, RunningAngles

# A keyboard repeats after 0.25 to 0.66 s for the first time, then 25 to 40 times a second. What
# repeats sooner for the first time is no new press but a stream that was held up on its way.
EARLIEST_REPEAT_NS = 180_000_000
FIRST_REPEAT_NS = 700_000_000
REPEAT_NS = 150_000_000
STOPS_AFTER_S = REPEAT_NS * 1e-9
# What is closer came out of one buffer.
_SAME_NS = 5_000_000

SPEEDS = (0.05, 1.0)
_FASTER = 1.25

HOME = 'h'
MOVES = {
    'left': (0, -1.0),
    'right': (0, 1.0),
    'down': (1, -1.0),
    'up': (1, 1.0),
    'a': (0, -1.0),
    'd': (0, 1.0),
    's': (1, -1.0),
    'w': (1, 1.0),
}
_HOLDS = (*MOVES, HOME)


class Request(StrEnum):
    """What a key asks for besides motion."""

    ENABLE = 'enable'
    PAUSE = 'pause'
    SMALLER = 'smaller scale'
    LARGER = 'larger scale'
    QUIT = 'quit'
    SUSPEND = 'suspend'


_REQUESTS = {
    'e': Request.ENABLE,
    'p': Request.PAUSE,
    '-': Request.SMALLER,
    '=': Request.LARGER,
    '+': Request.LARGER,
    'q': Request.QUIT,
    'ctrl+c': Request.QUIT,
    'ctrl+z': Request.SUSPEND,
}
_STOPPED_BY = {' ': 'stopped', FOCUS_LOST: 'the keyboard is at another window'}
_ONLY_OPEN = (Request.SMALLER, Request.LARGER)
_SPEEDS = {'[': 1.0 / _FASTER, ']': _FASTER}


@dataclass(frozen=True)
class Turn:
    """What the keyboard says at one turn."""

    position: tuple[float, ...]  # angles of the handle, rad, (J,)
    clutch: bool  # whether it is held
    homing: bool  # whether the way home is held
    requests: tuple[Request, ...]  # what else was asked for
    at_limit: tuple[bool, ...]  # joints that do not follow any further, (J,)


class _HeldKeys:
    """Which keys are down, and the number of the grip; 0 while none is known to be held."""

    def __init__(self, told_apart: bool) -> None:
        self._told_apart = told_apart
        self._down: dict[str, None] = {}
        self._grips = 0
        self.grip = 0
        self.lasts_ns = REPEAT_NS
        self._run_key = ''
        self._run_ns = 0
        self._run_length = 0

    @property
    def down(self) -> tuple[str, ...]:
        return tuple(self._down) if self.grip else ()

    def take(self, now_ns: int, event: KeyEvent) -> None:
        if self._told_apart:
            self._tell_apart(event)
        elif event.kind is not KeyEventKind.RELEASE:
            self._guess(now_ns, event.key)

    def _tell_apart(self, event: KeyEvent) -> None:
        if event.kind is KeyEventKind.RELEASE:
            self._down.pop(event.key, None)
            # Another key that is still down repeats no more on most machines.
            self.lasts_ns = FIRST_REPEAT_NS
            if not self._down:
                self.grip = 0
        elif event.kind is KeyEventKind.PRESS:
            self._down[event.key] = None
            self.lasts_ns = FIRST_REPEAT_NS
            if not self.grip:
                self._begin()
        elif event.key in self._down:
            self.lasts_ns = REPEAT_NS

    def _guess(self, now_ns: int, key: str) -> None:
        """Tell a key that is held by its repeats: the second event is the first of them."""
        apart = now_ns - self._run_ns
        most = FIRST_REPEAT_NS if self._run_length == 1 else REPEAT_NS
        if key != self._run_key or not self._run_length or apart > most:
            self.let_go()
            self._run_key, self._run_ns, self._run_length = key, now_ns, 1
        elif apart >= _SAME_NS:
            self._run_ns = now_ns
            self._run_length += 1
            if self._run_length == 2 and apart >= EARLIEST_REPEAT_NS:
                self._down = {key: None}
                self._begin()

    def _begin(self) -> None:
        self._grips += 1
        self.grip = self._grips

    def let_go(self) -> None:
        """Take all keys for released; one that goes on repeating begins no new grip."""
        self._down.clear()
        self.grip = 0

    def interrupt(self) -> None:
        """Another key ends what was held and what was about to be."""
        self.let_go()
        self._run_length = 0


class KeyboardHandle:
    """A handle whose angles run at a constant speed while a key is held.

    A held key is the dead-man. A terminal that tells presses from releases has the handle run from
    press to release, with two keys at once for both joints. One that does not has it run from the
    first repeat of a key to `STOPS_AFTER_S` after the last one. In both, silence ends it: after
    that time where a key was repeating, after 0.7 s where the first repeat was still to come; then
    the key has to be pressed again. Any key that is not held for motion ends it too.

    `told_apart`: the terminal tells presses and releases apart.
    """

    def __init__(self, joints: int, speed: float, told_apart: bool = False) -> None:
        self.dead_man = DeadMan()  # holds the clutch, and says why it does not
        self.speed = speed  # of the handle in rad/s, within `SPEEDS`
        self._keys = _HeldKeys(told_apart)
        self._angles = RunningAngles(joints)
        self._turned_ns: int | None = None
        self._was_held = False
        self._asked = '', 0

    @property
    def position(self) -> tuple[float, ...]:
        """Angles of the handle in rad, shape (J,)."""
        return tuple(self._angles.position)

    def turn(
        self,
        now_ns: int,
        events: Iterable[KeyEvent] = (),
        hindrance: str = '',
        wanted: Sequence[float] | None = None,
        scale: float = 1.0,
    ) -> Turn:
        """Take what was typed since the last turn, and say what the handle does now.

        `hindrance` is what forbids motion, empty for nothing; `wanted` (J,) what the master asks
        of the slave now, in rad, None while it follows nobody: the handle does not move before it
        does, nor away from what it has reached; `scale` the slave's motion for one radian.
        """
        requests = [r for event in events if (r := self._take(now_ns, event)) is not None]
        held = self.dead_man.turn(now_ns, hindrance)
        if self._keys.grip and not held:
            self._keys.let_go()
        down = self._keys.down
        homing = held and HOME in down
        clutch = held and not homing
        elapsed = 0.0 if self._turned_ns is None else (now_ns - self._turned_ns) * 1e-9
        self._turned_ns = now_ns
        at_limit = (False,) * len(self.position)
        if not clutch or not self._was_held:
            self._angles.release()
        else:
            usual = (self.speed,) * len(at_limit)
            at_limit = self._angles.run(self._speeds(down), usual, elapsed, wanted, scale)
        self._was_held = clutch
        if held:
            requests = [r for r in requests if r not in _ONLY_OPEN]
        return Turn(self.position, clutch, homing, tuple(requests), at_limit)

    def _take(self, now_ns: int, event: KeyEvent) -> Request | None:
        if event.key in _HOLDS:
            other_way = (event.key == HOME) != (HOME in self._keys.down)
            if event.kind is KeyEventKind.PRESS and other_way and self._keys.down:
                self._keys.interrupt()
            self._keys.take(now_ns, event)
            self.dead_man.hear(now_ns, self._keys.grip, self._keys.lasts_ns)
            return None
        if event.kind is not KeyEventKind.PRESS:
            return None
        if event.key in _SPEEDS:
            low, high = SPEEDS
            self.speed = min(high, max(low, self.speed * _SPEEDS[event.key]))
            return None
        self._keys.interrupt()
        self.dead_man.let_go(_STOPPED_BY.get(event.key, f'stopped by {event.key}'))
        request = _REQUESTS.get(event.key)
        (key, asked_ns), self._asked = self._asked, (event.key, now_ns)
        repeated = key == event.key and now_ns - asked_ns <= FIRST_REPEAT_NS
        return None if repeated and request not in _ONLY_OPEN else request

    def _speeds(self, down: Iterable[str]) -> list[float]:
        speeds = [0.0] * len(self.position)
        for key in down:
            joint, way = MOVES[key]
            speeds[joint] += way * self.speed
        return [max(-self.speed, min(self.speed, v)) for v in speeds]
