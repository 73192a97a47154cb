"""Who may move the slave: one operator, who gives it back, falls silent or is relieved."""

from dataclasses import dataclass

SILENCE_NS = 2_000_000_000
"""Without a sign of its holder the lease ends."""


@dataclass(frozen=True)
class Claim:
    """What became of a claim.

    Attributes
    ----------
    granted
        Whether the client holds the lease now.
    why
        Why not; empty when granted.
    lost_by
        Client from which it was taken; empty where nobody held it.
    """

    granted: bool
    why: str = ''
    lost_by: str = ''


class Lease:
    """The lease of the one operator; whoever only looks on never comes here.

    Every time is steady and in ns.

    Attributes
    ----------
    holder
        Client that holds it; empty for nobody.
    since_ns
        Since when; 0 for nobody.
    """

    def __init__(self) -> None:
        self.holder = ''
        self.since_ns = 0
        self._heard_ns = 0

    def claim(self, client: str, take: bool, now_ns: int) -> Claim:
        """Ask for the lease.

        Parameters
        ----------
        client
            Who asks.
        take
            Whether to take it from whoever holds it.
        now_ns
            Now.
        """
        if not client:
            raise ValueError('a client without a name cannot hold the lease')
        holder = self.holder
        if holder == client:
            self._heard_ns = now_ns
            return Claim(True)
        if holder and not take:
            return Claim(False, f'{holder} is the operator')
        self.holder, self.since_ns, self._heard_ns = client, now_ns, now_ns
        return Claim(True, lost_by=holder)

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
        if not self.holder or now_ns - self._heard_ns < SILENCE_NS:
            return ''
        silent = self.holder
        self.release(silent)
        return silent
