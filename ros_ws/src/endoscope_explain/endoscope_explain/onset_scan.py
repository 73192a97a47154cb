"""When something began: looked for over the whole recording, not only from where a fit stands.

The misfit has a valley at every motion that is like the one in which it began, and where friction
holds the joint it has none at all; a fit stays in the valley in which it started.
"""

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit.model import Fit, fit

Array = NDArray[np.float64]

ONSET = 'time_s'
"""Name of the parameters that say when."""
COARSE_S = 0.5
FINE_S = 0.1
FINE_REACH_S = 0.6
RISE = 'duration_s'
"""Name of the parameters that say how long it took to begin."""
SHORT_S = 0.02
REFIT_STEPS = 6


def redated(found: Fit) -> Fit:
    """Look whether what a fit has begin at one time began at another.

    Parameters
    ----------
    found : Fit

    Returns
    -------
    Fit
        The one given where no other time leads to a better one.
    """
    for place, item in enumerate(found.model.free):
        if item.name == ONSET:
            end = found.model.observation.duration
            found = _better(found, place, np.arange(COARSE_S, end, COARSE_S))
            dated = item.value(float(found.theta[place]))
            near = dated + np.arange(-FINE_REACH_S, FINE_REACH_S + 0.5 * FINE_S, FINE_S)
            found = _better(found, place, near[(near > 0.0) & (near < end)])
            found = _sharpened(found, place)
    return found


def _sharpened(found: Fit, place: int) -> Fit:
    """Look whether what a fit has rise slowly rose at once.

    The true instant and a slow rise around a later one are two valleys: in between, a joint held by
    friction moves at the wrong time.
    """
    free = found.model.free
    names = [item.name for item in free]
    if RISE not in names:
        return found
    rise_place = names.index(RISE)
    rise = free[rise_place].value(float(found.theta[rise_place]))
    dated = free[place].value(float(found.theta[place]))
    if rise <= SHORT_S or dated > found.model.observation.duration:
        return found
    for time in (dated - 0.5 * rise, dated):
        theta = found.theta.copy()
        theta[place] = free[place].coordinate(time)
        theta[rise_place] = free[rise_place].coordinate(SHORT_S)
        other = fit(found.model, theta, iterations=REFIT_STEPS)
        found = other if other.cost < found.cost else found
    return found


def _better(found: Fit, place: int, times: Array) -> Fit:
    if not len(times):
        # The fit has it begin after the recording's end, where nothing tells one time from another.
        return found
    span, _ = np.linalg.qr(np.delete(found.jacobian, place, axis=1))
    item = found.model.free[place]

    def left(theta: Array) -> float:
        """Squares that the other parameters could not take away."""
        residuals = found.model.residuals(theta)
        return float(residuals @ residuals - np.sum((span.T @ residuals) ** 2))

    def dated(time: float) -> Array:
        theta = found.theta.copy()
        theta[place] = item.coordinate(time)
        return theta

    misfits = [left(dated(float(time))) for time in times]
    best = int(np.argmin(misfits))
    if misfits[best] >= left(found.theta):
        return found
    other = fit(found.model, dated(float(times[best])), iterations=REFIT_STEPS)
    return other if other.cost < found.cost else found
