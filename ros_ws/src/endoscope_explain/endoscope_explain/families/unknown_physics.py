"""What belongs to no effect of the catalogue, as a function with its place, state and formula."""

import numpy as np

from endoscope_explain.explanation import UnknownTerm
from endoscope_explain.families.formula import nearest_formula
from endoscope_explain.families.function_search import FunctionFit, best_functions
from endoscope_explain.fit.model import Fit

RIVAL = 0.5
"""Share of the best gain above which another place is a rival: with no rival, 27 of 28 first names
were right in a study of rigs of other forms."""


def unknown_physics(
    found: Fit, jobs: int, siblings: tuple[str, ...]
) -> tuple[UnknownTerm, Fit] | None:
    """Find the missing function of a joint that no effect of the catalogue explains.

    Parameters
    ----------
    found : Fit
        The best that the catalogue can do.
    jobs : int
        Tasks side by side.
    siblings : tuple of str
        Nearest effects of the catalogue.

    Returns
    -------
    (UnknownTerm, Fit) or None
        The function, and the joint fitted with it; None where no function explains anything.
    """
    functions = [f for f in best_functions(found, jobs) if f.gain > 0.0]
    if not functions:
        return None
    best = functions[0]
    rivals = tuple(f.family.place.id for f in functions[1:] if f.gain > RIVAL * best.gain)
    return _term(found, best, rivals, siblings), best.fit


def _term(
    found: Fit, best: FunctionFit, rivals: tuple[str, ...], siblings: tuple[str, ...]
) -> UnknownTerm:
    place, formula = best.family.place, nearest_formula(best)
    before = float(np.sum(found.residuals**2))
    after = float(np.sum(best.fit.residuals**2))
    above = before - len(found.residuals)
    return UnknownTerm(
        found.model.observation.joint,
        place.id,
        place.physics.rstrip('.'),
        str(place.stage),
        place.unit,
        place.argument.symbol,
        f'{place.argument.words}, {place.argument.unit}',
        best.family.nodes,
        best.values,
        best.deviation,
        formula.expression,
        formula.values,
        formula.share,
        formula.as_good,
        float(np.clip((before - after) / max(above, 1.0), 0.0, 1.0)),
        rivals,
        siblings,
    )
