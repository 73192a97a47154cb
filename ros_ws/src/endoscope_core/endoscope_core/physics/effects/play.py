"""The play operator: what follows an angle through a gap."""

from endoscope_core.compiled import compiled


@compiled
def follow(follower: float, leader: float, half_gap: float) -> float:
    """Where a follower at `follower` is after its leader has moved to `leader`."""
    return min(leader + half_gap, max(leader - half_gap, follower))
