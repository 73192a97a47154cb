"""Who may move the slave: one operator, who gives it back, falls silent or is relieved."""

from dataclasses import dataclass

LEASE_SILENCE_NS = 2_000_000_000
"""Without a sign of its holder the lease ends."""
UNATTENDED_NS = 5_000_000_000
"""A motion session whose operator has gone is paused after so long without another one."""


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
