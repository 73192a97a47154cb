"""The servo's position loop, a system of second order."""

import math

from endoscope_core.compiled import compiled


@compiled
def transition(
    bandwidth: float, damping_ratio: float, step: float
) -> tuple[float, float, float, float]:
    """Exact transition of the servo over `step` s: rows of the matrix on (m - u, m').

    `bandwidth` in rad/s. Ogata, Modern Control Engineering, 5th ed. 2010, sec. 5-3.
    """
    sigma = damping_ratio * bandwidth
    discriminant = damping_ratio * damping_ratio - 1.0
    if discriminant < -1e-9:
        w = bandwidth * math.sqrt(-discriminant)
        decay = math.exp(-sigma * step)
        c, s = decay * math.cos(w * step), decay * math.sin(w * step) / w
    elif discriminant > 1e-9:
        w = bandwidth * math.sqrt(discriminant)
        # sigma - w without the difference of two large numbers.
        slow = math.exp(-bandwidth * bandwidth / (sigma + w) * step)
        fast = math.exp(-(sigma + w) * step)
        c, s = 0.5 * (slow + fast), 0.5 * (slow - fast) / w
    else:
        decay = math.exp(-sigma * step)
        c, s = decay, decay * step
    return c + sigma * s, s, -bandwidth * bandwidth * s, c - sigma * s
