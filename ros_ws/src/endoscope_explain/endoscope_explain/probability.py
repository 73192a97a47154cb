"""Probability that a named effect is present, from how far its rivals are behind."""

import math

GAP_SCALE = 12.0
CEILING = 0.97
INADEQUATE = 0.25
"""Probability of a name where the fit stays inadequate, however far its rivals are behind."""


def probability(gap: float, margin: float, adequate: bool, rivals: int) -> float:
    """Calibrated probability of a named effect.

    Parameters
    ----------
    gap : float
        Score lost by the best rival in its place.
    margin : float
        Score lost without it.
    adequate : bool
        Whether the whole explanation leaves little but noise.
    rivals : int
        Effects that the data cannot tell from it.

    Returns
    -------
    float
    """
    sure = 1.0 / (1.0 + math.exp(-min(gap, margin) / GAP_SCALE))
    value = CEILING * (2.0 * sure - 1.0)
    value = max(value, 1.0 / (1.0 + rivals) if rivals else 0.5)
    return min(value, CEILING if adequate else INADEQUATE)
