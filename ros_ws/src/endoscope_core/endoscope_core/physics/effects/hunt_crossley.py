"""Law of Hunt and Crossley: what pushes back, with loss, while something is pressed into it."""

from endoscope_core.compiled import compiled


@compiled
def push_back(
    depth: float, inwards: float, stiffness: float, exponent: float, loss: float
) -> tuple[float, float, float]:
    """Moment in N m at a depth > 0 in rad, and its slopes by depth and by speed inwards in rad/s.

    ``stiffness depth^exponent (1 + loss inwards)``, and never a pull: Hunt, Crossley, J. Appl.
    Mech. 42, 1975. Stiffness in N m/rad^exponent, loss in s/rad.
    """
    braked = 1.0 + loss * inwards
    if braked <= 0.0:
        return 0.0, 0.0, 0.0
    elastic = stiffness * depth**exponent
    return elastic * braked, exponent * elastic / depth * braked, elastic * loss
