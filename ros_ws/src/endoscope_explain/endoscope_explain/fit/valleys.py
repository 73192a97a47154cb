"""Numbers whose misfit has many valleys: looked for over their whole range.

The misfit has a valley at every motion that is like the one in which something began, and a whole
number has no derivative at all; a fit stays in the valley in which it started.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.fit.model import Fit, fit
from endoscope_explain.recording import Array

ONSET = 'time_s'
"""Name of the parameters of when something begins."""
RISE = 'duration_s'
"""Name of the parameters of how long it takes to begin."""
COARSE_S, FINE_S, FINE_REACH_S = 0.5, 0.1, 0.6
SHORT_S = 0.02
REFIT_STEPS = 6
STRIDES = (2, 1)


def out_of_valleys(found: Fit, weight: Array) -> Fit:
    """A fit at another onset or whole number if that leads to a better one, else the one given."""
    for place, item in enumerate(found.model.free):
        if item.name == ONSET:
            end = found.model.observation.duration
            found = _begun_elsewhere(found, place, np.arange(COARSE_S, end, COARSE_S), weight)
            dated = item.value(float(found.theta[place]))
            near = dated + np.arange(-FINE_REACH_S, FINE_REACH_S + 0.5 * FINE_S, FINE_S)
            near = near[(near > 0.0) & (near < end)]
            found = _begun_elsewhere(found, place, near, weight)
            found = _begun_at_once(found, place, weight)
    for index, admissible in _counted(found):
        found = _recounted(found, index, admissible, weight)
    return found


def _better(found: Fit, others: Iterable[Fit], weight: Array) -> Fit:
    def cost(each: Fit) -> float:
        return each.model.cost(weight * each.residuals, each.theta)

    return min([found, *others], key=cost)


def _begun_elsewhere(found: Fit, place: int, times: Array, weight: Array) -> Fit:
    if not len(times):
        # The fit has it begin after the recording's end, where all times are alike.
        return found
    slopes = found.jacobian * weight[:, None]
    span, _ = np.linalg.qr(np.delete(slopes, place, axis=1))
    item = found.model.free[place]

    def left(theta: Array) -> float:
        """Squares that the other parameters could not take away."""
        residuals = weight * found.model.residuals(theta)
        return float(residuals @ residuals - np.sum((span.T @ residuals) ** 2))

    def dated(time: float) -> Array:
        theta = found.theta.copy()
        theta[place] = item.coordinate(time)
        return theta

    misfits = [left(dated(float(time))) for time in times]
    best = int(np.argmin(misfits))
    if misfits[best] >= left(found.theta):
        return found
    again = fit(found.model, dated(float(times[best])), weight, REFIT_STEPS)
    return _better(found, [again], weight)


def _begun_at_once(found: Fit, place: int, weight: Array) -> Fit:
    """Look whether what a fit has rise slowly rose at once."""
    # The true instant and a slow rise around a later one are two valleys: in between, a joint held
    # by friction moves at the wrong time.
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
        found = _better(found, [fit(found.model, theta, weight, REFIT_STEPS)], weight)
    return found


def _counted(found: Fit) -> list[tuple[int, range]]:
    """Places of whole numbers in the packed parameters, and what they may be."""
    return [
        (place, range(int(parameter.low), int(parameter.high) + 1))
        for effect in CATALOGUE.values()
        if found.model.flags[effect.flag]
        for place, parameter in zip(effect.places, effect.parameters, strict=True)
        if parameter.counted
    ]


def _recounted(found: Fit, index: int, admissible: range, weight: Array) -> Fit:
    """Step a whole number up or down as long as the fit improves, first by two, then by one."""
    tried = {int(found.model.base[index])}
    for stride in STRIDES:
        improved = True
        while improved:
            now = int(found.model.base[index])
            numbers = {now - stride, now + stride}.intersection(admissible) - tried
            tried |= numbers
            others = []
            for number in sorted(numbers):
                base = found.model.base.copy()
                base[index] = number
                others.append(fit(replace(found.model, base=base), found.theta, weight))
            best = _better(found, others, weight)
            improved, found = best is not found, best
    return found
