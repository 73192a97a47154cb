"""When something begins during a recording: a step in time that is a continuous function of it."""

import math

from endoscope_core.compiled import compiled

STARTS = tuple(0.75 * k for k in range(1, 54))
"""Times in s where fits begin: between one motion and the next, a wrong one leads nowhere."""


@compiled
def share_after(onset: float, duration: float, smooth: float, time: float, tick: float) -> float:
    """Share in [0, 1] that has begun, in the mean over the tick around `time`; all in s.

    It rises for `duration` around `onset`: evenly, or along a half cosine if `smooth` is 1.
    """
    # Samples come once a tick: a step that takes as long shows in their sum wherever it lies.
    share = min(1.0, max(0.0, 0.5 + (time - onset) / (tick + duration)))
    return share if smooth == 0.0 else 0.5 - 0.5 * math.cos(math.pi * share)
