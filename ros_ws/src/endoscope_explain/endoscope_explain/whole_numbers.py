"""Fit again with other whole numbers, which no derivative leads to."""

from dataclasses import replace

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.compose import Composition
from endoscope_explain.fit.model import Fit, fit
from endoscope_explain.fit.score import score
from endoscope_explain.parallel import parallel_map

STRIDES = (2, 1)
ITERATIONS = 8


def _counted_places(effects: tuple[str, ...]) -> dict[int, range]:
    """Admissible whole numbers by their index in the packed parameters."""
    return {
        CATALOGUE[effect_id].first_parameter + i: range(int(p.low), int(p.high) + 1)
        for effect_id in effects
        for i, p in enumerate(CATALOGUE[effect_id].parameters)
        if p.counted
    }


def with_counted_numbers(composition: Composition, jobs: int) -> Composition:
    """The best fit of a composition over the whole numbers of its effects.

    Each number goes up or down as long as the fit improves, first by two, then by one.

    Parameters
    ----------
    composition : Composition
    jobs : int
        Tasks side by side.

    Returns
    -------
    Composition
        The one given where no other number fits better.
    """
    best = composition.fit
    for place, admissible in _counted_places(composition.effects).items():
        best = _counted(best, place, admissible, jobs)
    return Composition(composition.effects, best, score(best))


def _counted(best: Fit, place: int, admissible: range, jobs: int) -> Fit:
    tried = {int(best.model.base[place])}
    for stride in STRIDES:
        improved = True
        while improved:
            now = int(best.model.base[place])
            numbers = {now - stride, now + stride}.intersection(admissible) - tried
            tried |= numbers
            found = min([best, *_fits(best, place, sorted(numbers), jobs)], key=score)
            improved = found is not best
            best = found
    return best


def _fits(origin: Fit, place: int, numbers: list[int], jobs: int) -> list[Fit]:
    models = []
    for number in numbers:
        base = origin.model.base.copy()
        base[place] = number
        models.append(replace(origin.model, base=base))
    return parallel_map(lambda m: fit(m, origin.theta, iterations=ITERATIONS), models, jobs)
