"""When something begins during a recording: a step in time that is a continuous function of it."""

from endoscope_core.compiled import compiled

STARTS = tuple(0.75 * k for k in range(1, 54))
"""Times in s where fits begin: between one motion and the next, a wrong one leads nowhere."""


@compiled
def share_after(onset: float, time: float, tick: float) -> float:
    """Share in [0, 1] of the tick around `time`, all in s, that lies after `onset`.

    Samples come once a tick: a step that takes as long shows in their sum wherever it lies.
    """
    return min(1.0, max(0.0, 0.5 + (time - onset) / tick))
