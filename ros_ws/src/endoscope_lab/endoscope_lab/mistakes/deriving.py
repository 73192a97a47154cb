"""The numbers by which mistakes are judged, derived from recordings in which none was made."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.audit.criteria import DERIVED
from endoscope_explain.audit.misfit import Bounds, Criteria
from endoscope_explain.audit.plausibility import Comparison
from endoscope_explain.recording import Recording
from endoscope_lab.concealed.criteria import conformal
from endoscope_lab.mistakes.drawing import described, draw_recording, names_of

Array = NDArray[np.float64]

AGREE = 0.9
"""Share of signals that agree best, of which scales are learnt, and of the scales that hold."""
SOUND = 0.995
"""Share of recordings without a mistake of which none must be said."""
MOST_WORTH = 50.0
_HALVINGS = 8


@dataclass(frozen=True)
class Seen:
    """What a recording without a mistake says of one quantity: arrays of its columns."""

    scale: Array
    misfit: Array
    mean: Array


def sound_recording(seed: int) -> Recording:
    """A recording of a rig with one or two effects of up to their bounds; one in ten noiseless."""
    rng = np.random.default_rng(seed)
    noisy = bool(rng.random() < 0.9)
    return draw_recording(rng, names_of(rng), 0.3, 1.0, int(rng.integers(1, 3)), noisy)[0]


def seen(seed: int) -> dict[str, Seen]:
    """What the recording of a seed says of each quantity."""
    recording = sound_recording(seed)
    comparison = Comparison(recording, described(recording))
    found = {}
    for quantity, moments in comparison.moments().items():
        columns = len(moments.mean)
        free = Bounds(
            (-math.inf, math.inf),
            math.inf,
            comparison.noise[quantity],
            np.full(columns, comparison.noise[quantity]),
            -math.inf,
        )
        misfit, scale = np.diagonal(moments.misfit(1.0, free), axis1=1, axis2=2)
        found[quantity] = Seen(scale, misfit, moments.mean)
    return found


def least_worth(seed: int, criteria: Criteria) -> float:
    """From which worth on a mistake would be said of the recording of a seed."""
    recording = sound_recording(seed)
    comparison = Comparison(recording, described(recording), criteria=criteria)
    if not comparison.judged(MOST_WORTH):
        return math.inf
    low, high = 0.1, MOST_WORTH
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if comparison.judged(middle) else (middle, high)
    return low


def without_worth(rows: Sequence[dict[str, Seen]]) -> Criteria:
    """All criteria but the worth of a signal, which is judged by them."""
    scales, usual = {}, {}
    for quantity in DERIVED.scales:
        scale, misfit, _ = _together(rows, quantity)
        agree = misfit <= np.quantile(misfit, AGREE)
        low, high = np.quantile(scale[agree], [0.5 - 0.5 * AGREE, 0.5 + 0.5 * AGREE])
        scales[quantity] = (min(max(_round(low), 0.0), 1.0), max(_round(high), 1.0))
        usual[quantity] = _round(np.median(misfit))
    follows = _round(np.quantile(_together(rows, 'shaft_position')[1], AGREE))
    least = conformal(-_together(rows, 'tension')[2], SOUND)
    return Criteria(scales, usual, follows, -_round(least), math.nan)


def derived(criteria: Criteria, worths: Sequence[float]) -> Criteria:
    """Criteria with the largest worth of which nothing is said of nearly all recordings."""
    return replace(criteria, worth=_round(1.0 / conformal(1.0 / np.array(worths), SOUND)))


def sensitivity(criteria: Criteria, worths: Sequence[float]) -> str:
    """What half and double of the worth would do on the recordings."""
    shares = [
        f'{k * criteria.worth:.3g}: {np.mean(np.array(worths) < k * criteria.worth):.1%}'
        for k in (0.5, 1.0, 2.0)
    ]
    return 'worth, half, derived, double, and false alarms of each: ' + ', '.join(shares)


def source(criteria: Criteria, made_by: str) -> str:
    """The module that holds them."""

    def table(of: dict[str, object]) -> str:
        return '\n'.join(f"        '{name}': {value!r}," for name, value in of.items())

    return f'''"""Numbers by which mistakes are judged.

Made from recordings without any by {made_by}.
"""

from endoscope_explain.audit.misfit import Criteria

DERIVED = Criteria(
    scales={{
{table(dict(criteria.scales))}
    }},
    usual={{
{table(dict(criteria.usual))}
    }},
    follows={criteria.follows!r},
    least_tension={criteria.least_tension!r},
    worth={criteria.worth!r},
)
'''


def _together(rows: Sequence[dict[str, Seen]], quantity: str) -> tuple[Array, Array, Array]:
    of = [row[quantity] for row in rows]
    return (
        np.concatenate([s.scale for s in of]),
        np.concatenate([s.misfit for s in of]),
        np.concatenate([s.mean for s in of]),
    )


def _round(value: float) -> float:
    return float(f'{value:.3g}')
