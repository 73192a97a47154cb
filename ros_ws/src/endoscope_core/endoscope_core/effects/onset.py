"""When something begins during a recording: a step in time that is a continuous function of it."""

from endoscope_core.compiled import compiled


@compiled
def share_after(onset: float, start: float, duration: float) -> float:
    """Share in [0, 1] of the interval from `start`, `duration` s long, that lies after `onset`."""
    return min(1.0, max(0.0, (start + duration - onset) / duration))
