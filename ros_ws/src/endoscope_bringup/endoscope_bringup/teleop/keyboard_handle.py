"""A handle that is made of keys that repeat: keys and time in, angles and clutch out."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from endoscope_core.teleop import DeadMan, RunningAngles

# A keyboard repeats after 0.25 to 0.66 s for the first time, then 25 to 40 times a second. What
# repeats sooner for the first time is no new press but a stream that was held up on its way.
EARLIEST_REPEAT_NS = 180_000_000
FIRST_REPEAT_NS = 700_000_000
REPEAT_NS = 150_000_000
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
    QUIT = 'quit'


_REQUESTS = {'e': Request.ENABLE, 'p': Request.PAUSE, 'q': Request.QUIT}
_SPEEDS = {'[': 1.0 / _FASTER, ']': _FASTER}


@dataclass(frozen=True)
class Turn:
    """State of the keyboard at one turn."""

    position: tuple[float, ...]  # angles of the handle, rad, (J,)
    clutch: bool  # whether it is held
    homing: bool  # whether the way home is held
    requests: tuple[Request, ...]  # what else was asked for
    at_limit: tuple[bool, ...]  # joints that do not follow any further, (J,)


class KeyboardHandle:
    """A handle one of whose angles runs at a constant speed while a key is held."""

    # A held key is the dead-man: the handle runs from the first repeat of a key until `REPEAT_NS`
    # after the last one, or until any other key is pressed. Then the key has to be released and
    # pressed again.

    def __init__(self, joints: int, speed: float) -> None:
        self.dead_man = DeadMan()  # holds the clutch, and says why it does not
        self.speed = speed  # of the handle in rad/s, within `SPEEDS`
        self._angles = RunningAngles(joints)
        self._turned_ns: int | None = None
        self._was_held = False
        self._asked = '', 0
        self._grips = self._grip = 0  # how many there were, and which one is held; 0 for none
        self._key, self._key_ns, self._times = '', 0, 0

    @property
    def position(self) -> tuple[float, ...]:
        """Angles of the handle in rad, shape (J,)."""
        return tuple(self._angles.position)

    def turn(
        self,
        now_ns: int,
        keys: Iterable[str] = (),
        hindrance: str = '',
        wanted: Sequence[float] | None = None,
        scale: float = 1.0,
    ) -> Turn:
        """Take the keys typed since the last turn, and return the handle's state."""
        # `hindrance` is what forbids motion, empty for nothing; `wanted` (J,) what the master asks
        # of the slave now, in rad, None while it follows nobody: the handle does not move before it
        # does, nor away from what it has reached; `scale` the slave's motion for one radian.
        requests = [r for key in keys if (r := self._take(now_ns, key)) is not None]
        held = self.dead_man.turn(now_ns, hindrance)
        if not held:
            self._grip = 0
        homing = held and self._key == HOME
        clutch = held and not homing
        elapsed = 0.0 if self._turned_ns is None else (now_ns - self._turned_ns) * 1e-9
        self._turned_ns = now_ns
        at_limit = (False,) * len(self.position)
        if not clutch or not self._was_held:
            self._angles.release()
        else:
            joint, way = MOVES[self._key]
            speeds = [way * self.speed * (k == joint) for k in range(len(at_limit))]
            usual = (self.speed,) * len(at_limit)
            at_limit = self._angles.run(speeds, usual, elapsed, wanted, scale)
        self._was_held = clutch
        return Turn(self.position, clutch, homing, tuple(requests), at_limit)

    def _take(self, now_ns: int, key: str) -> Request | None:
        if key in _HOLDS:
            self._repeat(now_ns, key)
            self.dead_man.hear(now_ns, self._grip, REPEAT_NS)
            return None
        if key in _SPEEDS:
            low, high = SPEEDS
            self.speed = min(high, max(low, self.speed * _SPEEDS[key]))
            return None
        self._grip = self._times = 0
        self.dead_man.let_go('stopped' if key == ' ' else f'stopped by {key}')
        (before, asked_ns), self._asked = self._asked, (key, now_ns)
        repeated = before == key and now_ns - asked_ns <= FIRST_REPEAT_NS
        return None if repeated else _REQUESTS.get(key)

    def _repeat(self, now_ns: int, key: str) -> None:
        """Detect a held key by its repeats: the second time is the first of them."""
        apart = now_ns - self._key_ns
        most = FIRST_REPEAT_NS if self._times == 1 else REPEAT_NS
        if key != self._key or not self._times or apart > most:
            self._grip = 0
            self._key, self._key_ns, self._times = key, now_ns, 1
        elif apart >= _SAME_NS:
            self._key_ns = now_ns
            self._times += 1
            if self._times == 2 and apart >= EARLIEST_REPEAT_NS:
                self._grips += 1
                self._grip = self._grips
