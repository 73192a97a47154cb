"""Nominal numbers beyond their band, where what was fitted leans on its end.

A rig that is described wrongly by a third lacks no physics. Within its band no refit shows that,
and an effect that can do a wrong number's work would be named for it.
"""

from dataclasses import replace

import numpy as np

from endoscope_explain.compose import Composition
from endoscope_explain.fit.free_parameters import SCALED_NOMINAL, FreeParameter
from endoscope_explain.fit.model import Fit, fit
from endoscope_explain.fit.score import score

FURTHEST = 4.0
"""Factor by which a description may be wrong, either way."""
ITERATIONS = 20
AT_THE_END = 1e-3
"""Relative distance from the end of a band within which a number leans on it."""


def leans(fitted: Fit) -> bool:
    """Return whether a fit holds a nominal number at an end of its band."""
    low, high = fitted.model.bounds()
    at_the_end = np.minimum(fitted.theta - low, high - fitted.theta) < AT_THE_END
    free = fitted.model.free
    return any(e and i.name in SCALED_NOMINAL for e, i in zip(at_the_end, free, strict=True))


def beyond_band(composition: Composition) -> Composition:
    """Refit a composition with nominal numbers that may leave their band.

    The priors stay, so that a number far from its description has its price.
    """
    model = composition.fit.model
    model = replace(model, free=tuple(_widened(item) for item in model.free))
    found = fit(model, composition.fit.theta, iterations=ITERATIONS)
    return Composition(composition.effects, found, score(found))


def leaves_band_of(fitted: Fit, nominal: Fit) -> bool:
    """Return whether all nominal numbers of a fit may leave the band that a nominal fit has."""
    pairs = zip(fitted.model.free, nominal.model.free, strict=False)
    return all(a != b for a, b in pairs if a.name in SCALED_NOMINAL)


def _widened(item: FreeParameter) -> FreeParameter:
    if item.name not in SCALED_NOMINAL:
        return item
    described = float(np.exp(item.mean))
    return replace(
        item, low=min(item.low, described / FURTHEST), high=max(item.high, described * FURTHEST)
    )
