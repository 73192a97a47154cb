"""Fit again from many starts where sticking and slipping makes the cost rugged."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.compose import Composition
from endoscope_explain.fit import Fit, fit
from endoscope_explain.parallel import parallel_map
from endoscope_explain.score import score
from endoscope_explain.screen import starting_points, with_effect

Array = NDArray[np.float64]

RUGGED = 'stribeck_friction'
"""The effect under which the joint sticks and slips."""
ITERATIONS = 12
REFINED = 2
"""Best fits that are gone on with by derivatives over other widths."""
WIDTHS = (0.05, 0.02, 0.05, 0.02)
"""What looks like a wall over one width is a slope over another."""


def from_many_starts(composition: Composition, anchor: Fit, jobs: int) -> Composition:
    """The best fit of a single effect over all starts that make the wire stick and slip.

    A slip that begins earlier or later moves all that follows it, so that a fit ends in the valley
    it began in, and one look at each start does not tell which valley is the deepest.

    Parameters
    ----------
    composition : Composition
        Has `RUGGED` alone.
    anchor : Fit
        The nominal plant as described: refitted to slips that it cannot make, it lies in a corner.
    jobs : int
        Processes side by side.

    Returns
    -------
    Composition
        The one given where no start leads to a better one.
    """
    models = [
        with_effect(anchor.model, RUGGED, start)
        for start in starting_points(RUGGED)
        if start['lagging'] > 0.0
    ]

    def numbers(index: int) -> tuple[Array, Array, Array, float]:
        model = models[index]
        own = [
            item.coordinate(float(model.base[item.index]))
            for item in model.free[len(anchor.theta) :]
        ]
        done = fit(model, np.concatenate([anchor.theta, own]), iterations=ITERATIONS)
        return done.theta, done.residuals, done.jacobian, done.cost

    found = [
        Fit(model, *values)
        for model, values in zip(
            models, parallel_map(numbers, range(len(models)), jobs), strict=True
        )
    ]
    tried = sorted(
        (Composition(composition.effects, item, score(item)) for item in (composition.fit, *found)),
        key=lambda c: c.score,
    )

    def refined(index: int) -> tuple[Array, Array, Array, float]:
        best = tried[index].fit
        for width in WIDTHS:
            other = fit(replace(best.model, wide_step=width), best.theta, iterations=ITERATIONS)
            best = other if other.cost < best.cost else best
        return best.theta, best.residuals, best.jacobian, best.cost

    for index, values in enumerate(parallel_map(refined, range(REFINED), jobs)):
        item = Fit(tried[index].fit.model, *values)
        tried.append(Composition(composition.effects, item, score(item)))
    return min(tried, key=lambda c: c.score)
