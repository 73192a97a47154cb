"""A second look at a composition of two effects: whether each is needed, and the right one.

What was fitted while another effect was missing may have stopped in the wrong place. Seen from the
composition's own numbers, one effect alone may do, or another one may do better beside the other.
"""

from collections.abc import Sequence

import numpy as np

from endoscope_explain.compose import Composition, grow
from endoscope_explain.fit.model import Fit, fit, without_effect
from endoscope_explain.fit.score import score
from endoscope_explain.fit.whiteness import is_noise

REPLACED_POLISHED = 2
ALONE_STEPS = 6


def alone(pair: Composition, effect_id: str) -> tuple[Composition, Fit]:
    """One effect of a pair by itself, refitted from where the pair has it.

    Parameters
    ----------
    pair : Composition
    effect_id : str
        Of the pair.

    Returns
    -------
    refitted : Composition
    as_in_pair : Fit
        The effect with the pair's numbers, before the refit.
    """
    (other,) = set(pair.effects) - {effect_id}
    model, theta = without_effect(pair.fit, other)
    refitted = fit(model, theta, iterations=ALONE_STEPS)
    as_in_pair = Fit(model, theta, model.residuals(theta), refitted.jacobian, np.inf)
    return Composition((effect_id,), refitted, score(refitted)), as_in_pair


def reconsidered(
    nominal: Composition, pair: Composition, effects: Sequence[str], jobs: int
) -> tuple[list[Composition], list[Composition]]:
    """Look again at both effects of a pair.

    Parameters
    ----------
    nominal, pair : Composition
    effects : sequence of str
        Those that may be tried in place of one of the pair.
    jobs : int
        Tasks side by side.

    Returns
    -------
    singles : list of Composition
        Each effect alone.
    pairs : list of Composition
        Others in the place of the effect that was chosen first.
    """
    found = [alone(pair, effect_id) for effect_id in pair.effects]
    singles = [single for single, _ in found]
    if is_noise(pair.fit):
        return singles, []
    last, as_in_pair = found[-1]
    pairs = grow([(last, (as_in_pair, last.fit))], effects, jobs, REPLACED_POLISHED)
    return singles, pairs
