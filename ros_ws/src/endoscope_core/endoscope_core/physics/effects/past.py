"""What a ring of past values held a while ago."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.layout import HISTORY


@compiled
def value_before(ring: Array, ticks: float, delay: float, tick: float) -> float:
    """Value that a ring (HISTORY,) held `delay` s before tick `ticks`, interpolated."""
    # The ring reaches back to before the start, where everything was at rest.
    # Without the cut a tick longer than usual would reach beyond what the ring still holds.
    back = min(delay / tick, HISTORY - 2.0)
    whole = int(back)
    newer = ring[(int(ticks) - whole) % HISTORY]
    older = ring[(int(ticks) - whole - 1) % HISTORY]
    # A value held between ticks is, in the mean over a delayed tick, that same interpolation.
    return newer + (back - whole) * (older - newer)
