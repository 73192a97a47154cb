"""Forward selection: the terms that lower the residual most, one after the other."""

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.benchmark.peers.term_library import SIGNALS, Problem

Array = NDArray[np.float64]

STEPS = 3


def name_by_forward_selection(problem: Problem) -> str:
    """Name the effect whose terms explain most after a few steps.

    Orthogonal matching pursuit (Pati, Rezaiifar, Krishnaprasad, Asilomar 1993) with a price for
    each coefficient (Schwarz, Ann. Stat. 6, 1978).

    Parameters
    ----------
    problem : Problem

    Returns
    -------
    str
    """
    count = len(problem.residuals)
    columns = np.stack([term.values for term in problem.terms])
    shows = np.array([[c in term.signals for c in range(SIGNALS)] for term in problem.terms])
    # What of each term the chosen ones do not hold, and what of each residual they leave.
    free = [columns.copy() for _ in range(SIGNALS)]
    left = problem.residuals.T.copy()
    gained: dict[str, float] = {}
    for _ in range(STEPS):
        gains = np.zeros(len(columns))
        for c in range(SIGNALS):
            power = np.maximum(np.sum(free[c] ** 2, axis=1), 1e-9)
            whole = max(float(left[c] @ left[c]), 1e-9)
            share = np.clip((free[c] @ left[c]) ** 2 / power / whole, 0.0, 1.0 - 1e-12)
            gains += shows[:, c] * (-0.5 * count * np.log1p(-share) - 0.5 * np.log(count))
        best = int(np.argmax(gains))
        if gains[best] <= np.log(count):
            break
        for shown in map(int, np.flatnonzero(shows[best])):
            unit = free[shown][best] / max(float(np.linalg.norm(free[shown][best])), 1e-9)
            left[shown] -= (unit @ left[shown]) * unit
            free[shown] -= np.outer(free[shown] @ unit, unit)
        effect = problem.terms[best].effect
        gained[effect] = gained.get(effect, 0.0) + float(gains[best])
    return max(gained, key=lambda k: gained[k], default='nothing')
