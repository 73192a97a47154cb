"""Law of Hunt and Crossley: what pushes back, with loss, while something is pressed into it."""

from endoscope_core.compiled import compiled


@compiled
def push_back(
    depth: float, inwards: float, stiffness: float, exponent: float, loss: float
) -> tuple[float, float, float]:
    """Moment in N m of what is pressed in by `depth` at a speed, and its slopes.

    ``stiffness depth^exponent (1 + loss inwards)``, and never a pull: Hunt, Crossley, J. Appl.
    Mech. 42, 1975.

    `depth`: rad, positive.
    `inwards`: speed at which it goes deeper, rad/s.
    `stiffness`: n m/rad^exponent.
    `loss`: s/rad.
    Returns `by_depth`: n m/rad.
    Returns `by_speed`: n m s/rad.
    """
    braked = 1.0 + loss * inwards
    if braked <= 0.0:
        return 0.0, 0.0, 0.0
    elastic = stiffness * depth**exponent
    return elastic * braked, exponent * elastic / depth * braked, elastic * loss
