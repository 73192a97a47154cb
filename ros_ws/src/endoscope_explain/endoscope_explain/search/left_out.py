"""What a candidate is worth in a recording that it was not fitted to, of several of one rig.

The evidence of all recordings together does not distinguish an effect of the instrument from one
that only bends with its numbers: a wall, or a distorted tracker, with other numbers in each tube
explains every single one of them. Leaving one recording out does (Stone, J. R. Stat. Soc. B 36,
1974): the others show what the instrument is like, and what the shape of a tube changes is fitted
anew.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import t as student

from endoscope_core.physics.layout import IN_COMMAND
from endoscope_explain.fit.evidence import counts, log_likelihood, mean_squares
from endoscope_explain.fit.model import Fit
from endoscope_explain.fit.pooled import foretold
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.recording import Array

LEAST_RECORDINGS = 3
"""Two show nothing of how much a gain scatters from one recording to the next."""
SAME_COMMAND = 0.02
"""Rms of the difference of two commands, over that of one, below which they are the same motion."""


def likelihoods(fits: Sequence[Fit]) -> Array:
    """Logarithm (n,) of the likelihood of each recording, by what the others show of the rig."""
    seen = [each.model.observation for each in fits]
    return np.array(
        [
            log_likelihood(mean_squares(observation, residuals), counts(observation))
            for observation, residuals in zip(seen, foretold(fits), strict=True)
        ]
    )


def chance(gains: Array) -> float:
    """Chance of gains (n,) like these where what was added is worth nothing."""
    # Student's test of paired differences, for recordings are independent and their samples are
    # not. Where each recording gains, but one much more than another, it shows little; there the
    # chance that the weakest of them gains as much bounds it: a likelihood ratio is larger than its
    # inverse by no more chance than that (Ville's inequality).
    scatter = float(np.std(gains, ddof=1)) / np.sqrt(len(gains))
    if scatter == 0.0:
        return 0.0 if np.mean(gains) > 0.0 else 1.0
    by_mean = float(student.sf(np.mean(gains) / scatter, len(gains) - 1))
    return min(by_mean, float(np.exp(min(0.0, -np.min(gains)))))


def repeat_one_motion(observations: Sequence[JointObservation]) -> bool:
    """Whether all recordings are of one motion, so that none distinguishes time from states."""
    first, *others = (each.inputs[0, :, IN_COMMAND] for each in observations)
    for other in others:
        length = min(len(first), len(other))
        apart = first[:length] - other[:length]
        if np.mean(apart**2) > SAME_COMMAND**2 * np.mean(first[:length] ** 2):
            return False
    return True
