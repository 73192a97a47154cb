"""Fit again from many starts where sticking and slipping makes the cost rugged."""

from dataclasses import replace

from endoscope_explain.compose import Composition
from endoscope_explain.fit.model import Fit, JointModel, fit
from endoscope_explain.fit.score import score
from endoscope_explain.parallel import parallel_map
from endoscope_explain.screen import starting_points, with_effect

ITERATIONS = 12
REFINED = 2
"""Best fits that are gone on with by derivatives over other widths."""
WIDTHS = (0.05, 0.02, 0.05, 0.02)
"""What looks like a wall over one width is a slope over another."""


def from_many_starts(composition: Composition, anchor: Fit, jobs: int) -> Composition:
    """The best fit of a single rugged effect over all its starts.

    A slip that begins earlier or later moves all that follows it, so that a fit ends in the valley
    it began in, and one look at each start does not tell which valley is the deepest.

    Parameters
    ----------
    composition : Composition
        Has one effect.
    anchor : Fit
        The nominal plant as described: refitted to slips that it cannot make, it lies in a corner.
    jobs : int
        Tasks side by side.

    Returns
    -------
    Composition
        The one given where no start leads to a better one.
    """
    (effect_id,) = composition.effects
    models = [with_effect(anchor.model, effect_id, start) for start in starting_points(effect_id)]

    def fitted(model: JointModel) -> Fit:
        return fit(model, model.begun_at(anchor.theta), iterations=ITERATIONS)

    found = [composition.fit, *parallel_map(fitted, models, jobs)]
    best = sorted(found, key=score)[:REFINED]

    def refined(found: Fit) -> Fit:
        narrowed = found
        for width in WIDTHS:
            model = replace(narrowed.model, wide_step=width)
            other = fit(model, narrowed.theta, iterations=ITERATIONS)
            narrowed = other if other.cost < narrowed.cost else narrowed
        return replace(narrowed, model=found.model)

    found += parallel_map(refined, best, jobs)
    chosen = min(found, key=score)
    return Composition(composition.effects, chosen, score(chosen))
