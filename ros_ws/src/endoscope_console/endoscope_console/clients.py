"""The connected pages: their number, rate limits and outboxes, and who of them moves the slave."""

import asyncio
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

from endoscope_console.access import VIEWER

Kind = Literal['telemetry', 'command']

HELLO_S = 2.0
"""Time limit for the hello of a socket."""
UNANSWERED = 8
"""Largest number of sockets without a hello."""
OF_A_KIND = 16
VIEWERS_OF_A_KIND = 4
FRAMES_A_SECOND = 200
QUEUED = 2
"""Pictures that wait for a slow client; older ones are dropped."""
ORDERS_AT_ONCE = 8
"""Orders of one client that are not answered yet."""

_SECOND_NS = 1_000_000_000
LEASE_SILENCE_NS = 2_000_000_000
"""Without a sign of its holder the lease ends."""
UNATTENDED_NS = 5_000_000_000
"""A motion session whose operator has gone is paused after so long without another one."""


class FrameRate:
    """Whether a client sends more than `limit` frames a second: an allowance that refills."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._left = float(limit)
        self._at_ns: int | None = None

    def exceeded(self, now_ns: int) -> bool:
        """Take one more frame, at a steady time in ns; whether it is one too many."""
        if self._at_ns is not None:
            earned = (now_ns - self._at_ns) * self._limit / _SECOND_NS
            self._left = min(float(self._limit), self._left + earned)
        self._at_ns = now_ns
        self._left -= 1.0
        return self._left < 0.0


class Outbox:
    """Queue to a client: the newest pictures, and the newest state."""

    def __init__(self) -> None:
        self.dropped = 0  # pictures that it never got, since newer ones came
        self._pictures: deque[bytes] = deque()
        self._state = ''
        self._filled = asyncio.Event()

    def put_picture(self, picture: bytes) -> None:
        """Add a picture; the oldest is dropped."""
        if len(self._pictures) == QUEUED:
            self._pictures.popleft()
            self.dropped += 1
        self._pictures.append(picture)
        self._filled.set()

    def put_state(self, state: str) -> None:
        """Replace the state by a newer one."""
        self._state = state
        self._filled.set()

    async def get(self) -> bytes | str:
        """Wait for what comes next."""
        while True:
            if self._state:
                state, self._state = self._state, ''
                return state
            if self._pictures:
                return self._pictures.popleft()
            self._filled.clear()
            await self._filled.wait()


@dataclass(eq=False)
class Client:
    """A socket after its hello."""

    id: str  # its name, ``c3``
    kind: Kind  # which socket
    role: str  # what its bearer may be
    address: str  # of the machine it comes from
    rate: FrameRate = field(default_factory=lambda: FrameRate(FRAMES_A_SECOND))
    outbox: Outbox = field(default_factory=Outbox)  # what waits for it, on the socket for telemetry
    # Sends it an object that it did not ask for, on the socket for commands.
    notify: Callable[[dict[str, object]], None] = lambda message: None
    orders: int = 0  # not answered yet

    @property
    def label(self) -> str:
        """Name for a person."""
        return f'{self.id} at {self.address}'


class Clients:
    """All sockets, within the limits; `counts` is of what is refused and dropped."""

    def __init__(self, counts: Counter[str]) -> None:
        self.counts = counts
        self._open: dict[str, Client] = {}
        self._made = 0
        self._unanswered = 0

    def knock(self) -> bool:
        """Note a socket that opens; false where too many are without a hello."""
        if self._unanswered >= UNANSWERED:
            self.counts['refused: too many sockets without hello'] += 1
            return False
        self._unanswered += 1
        return True

    def answered(self) -> None:
        """Note the hello of a socket, or its end before that."""
        self._unanswered -= 1

    def admit(self, kind: Kind, role: str, address: str) -> Client | str:
        """Make a client of a socket after its hello; or why not."""
        of_kind = [client for client in self._open.values() if client.kind == kind]
        if len(of_kind) >= OF_A_KIND:
            self.counts['refused: too many clients'] += 1
            return f'{OF_A_KIND} pages are connected already'
        viewers = sum(client.role == VIEWER for client in of_kind)
        if role == VIEWER and viewers >= VIEWERS_OF_A_KIND:
            self.counts['refused: too many viewers'] += 1
            return f'{VIEWERS_OF_A_KIND} viewers are connected already'
        self._made += 1
        client = Client(f'c{self._made}', kind, role, address)
        self._open[client.id] = client
        return client

    def leave(self, client: Client) -> None:
        """Forget one that is gone."""
        del self._open[client.id]
        self.counts['pictures dropped'] += client.outbox.dropped

    def of(self, kind: Kind) -> list[Client]:
        """Those of one kind, oldest first."""
        return [client for client in self._open.values() if client.kind == kind]

    def by_id(self, name: str) -> Client | None:
        """The one of that name."""
        return self._open.get(name)

    @property
    def dropped(self) -> int:
        """Pictures that those who are connected never got."""
        return sum(client.outbox.dropped for client in self._open.values())


@dataclass(frozen=True)
class ClaimOutcome:
    """Outcome of a claim."""

    granted: bool  # whether the client holds the lease now
    why: str = ''  # why not
    lost_by: str = ''  # client from which it was taken; empty where nobody held it


class Lease:
    """The lease of the one operator; every time is steady and in ns."""

    def __init__(self) -> None:
        self.holder = ''  # client; empty for nobody
        self.since_ns = 0  # 0 for nobody
        self._heard_ns = 0

    def claim(self, client: str, take: bool, now_ns: int) -> ClaimOutcome:
        """Ask for the lease, or `take` it from whoever holds it."""
        if not client:
            raise ValueError('a client without a name cannot hold the lease')
        holder = self.holder
        if holder == client:
            self._heard_ns = now_ns
            return ClaimOutcome(True)
        if holder and not take:
            return ClaimOutcome(False, f'{holder} is the operator')
        self.holder, self.since_ns, self._heard_ns = client, now_ns, now_ns
        return ClaimOutcome(True, lost_by=holder)

    def release(self, client: str) -> None:
        """Give the lease back; nothing where another holds it."""
        if client == self.holder:
            self.holder, self.since_ns = '', 0

    def heard(self, client: str, now_ns: int) -> None:
        """Take a sign of a client at `now_ns`."""
        if client == self.holder:
            self._heard_ns = max(self._heard_ns, now_ns)

    def turn(self, now_ns: int) -> str:
        """Judge at `now_ns`: who has just lost the lease by silence; empty for nobody."""
        if not self.holder or now_ns - self._heard_ns < LEASE_SILENCE_NS:
            return ''
        silent = self.holder
        self.release(silent)
        return silent


class Attendance:
    """Whether a motion session that had an operator goes on without one; steady ns."""

    def __init__(self) -> None:
        self._session = ''
        self._attended_ns = 0
        self.lacks = False  # the session that is open has lost its operator

    def turn(self, now_ns: int, session: str, attended: bool) -> bool:
        """Judge at `now_ns`; whether to pause.  `session` is the one that is open, or empty."""
        if session and attended:
            self._session, self._attended_ns = session, now_ns
        self.lacks = bool(session) and session == self._session and not attended
        if not self.lacks or now_ns - self._attended_ns < UNATTENDED_NS:
            return False
        # Asked for again where it stays without effect.
        self._attended_ns = now_ns
        return True
