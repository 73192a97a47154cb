"""One set of effects for several recordings of a rig, and the sets with one effect more.

The sum of all scores decides, each recording with parameters of its own.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.effects import CATALOGUE
from endoscope_explain.agreement import agreed_parameters, in_line, must_agree
from endoscope_explain.compose import searchable_effects
from endoscope_explain.fit import Fit, JointModel
from endoscope_explain.given_physics import settled
from endoscope_explain.glance import Glance, glance
from endoscope_explain.parallel import parallel_map
from endoscope_explain.parallel_fits import parallel_fits
from endoscope_explain.rank import Look, polish
from endoscope_explain.repeated_motion import DEPENDS_ON_TIME, motion_repeats
from endoscope_explain.score import score
from endoscope_explain.screen import Promise, promises, unexplained
from endoscope_explain.whiteness import is_noise

Array = NDArray[np.float64]
Anchors = tuple[Fit, ...]
Variant = tuple[str, tuple[float, ...]]
"""An effect, and what it acts on or which of its forms it has, which no shape of a tube changes."""

STARTS = 2
"""Starting points of an effect that get a cheap fit."""
POLISHED_FIRST, POLISHED = 6, 3
"""Effects that are fitted fully to all recordings, beside no other one and beside others."""


@dataclass(frozen=True)
class SharedChoice:
    """Effects for all recordings of a joint.

    Attributes
    ----------
    joint : str
    effects : tuple of str
        In the order in which they were added.
    recordings : tuple of anchors
        Fits of each recording; see `rank.look`. One that has no use for an effect lacks it.
    """

    joint: str
    effects: tuple[str, ...]
    recordings: tuple[Anchors, ...]

    def total(self) -> float:
        """Sum of the scores of all recordings."""
        return sum(score(anchors[0]) for anchors in self.recordings)

    def fall_to(self, other: 'SharedChoice') -> float:
        """Mean fall of the score of a recording from this choice to another."""
        return (self.total() - other.total()) / len(self.recordings)

    def leaves_noise(self) -> bool:
        """Whether nothing is left to explain in any recording."""
        return all(is_noise(anchors[0]) for anchors in self.recordings)


def with_one_more(choice: SharedChoice, jobs: int) -> list[SharedChoice]:
    """The choice with one more effect, for each of the most promising effects.

    Parameters
    ----------
    choice : SharedChoice
    jobs : int
        Processes side by side.

    Returns
    -------
    list of SharedChoice
        Best first.
    """
    glances = _glances(choice, jobs)
    variants: dict[str, Variant] = {}
    for variant in sorted(glances, key=lambda v: _logarithm_of_costs(choice, glances[v])):
        variants.setdefault(variant[0], variant)
    promising = list(variants.values())[: POLISHED if choice.effects else POLISHED_FIRST]
    return sorted(
        (_grown(choice, v[0], glances[v], jobs) for v in promising), key=SharedChoice.total
    )


def _glances(choice: SharedChoice, jobs: int) -> dict[Variant, list[Glance | None]]:
    """The best cheap fit of each promising variant of an effect, for each recording."""
    recordings = choice.recordings
    repeated = all(motion_repeats(anchors[0].model.observation) for anchors in recordings)
    tasks = [
        (e, n)
        for e in searchable_effects()
        if e not in choice.effects and (repeated or e not in DEPENDS_ON_TIME)
        for n in range(len(recordings))
    ]
    left = [unexplained(anchors[0]) for anchors in recordings]

    def glanced(task: tuple[str, int]) -> dict[Variant, Glance]:
        effect_id, n = task
        starts: dict[Variant, list[Promise]] = {}
        for promise in promises(left[n], effect_id):
            starts.setdefault(_variant(promise), []).append(promise)
        return {
            variant: min(
                (glance(recordings[n], choice.effects, start) for start in own[:STARTS]),
                key=lambda item: item.cost,
            )
            for variant, own in starts.items()
        }

    glances: dict[Variant, list[Glance | None]] = {}
    for (_, n), found in zip(tasks, parallel_map(glanced, tasks, jobs), strict=True):
        for variant, item in found.items():
            glances.setdefault(variant, [None] * len(recordings))[n] = item
    return glances


def _variant(promise: Promise) -> Variant:
    parameters = CATALOGUE[promise.effect_id].parameters
    return promise.effect_id, tuple(promise.start[p.name] for p in parameters if p.choices)


def _logarithm_of_costs(choice: SharedChoice, glances: list[Glance | None]) -> float:
    return sum(
        math.log(anchors[0].cost if item is None else min(item.cost, anchors[0].cost))
        for anchors, item in zip(choice.recordings, glances, strict=True)
    )


def _grown(
    choice: SharedChoice, effect_id: str, glances: list[Glance | None], jobs: int
) -> SharedChoice:
    """All recordings with one more effect; a recording that has no use for it stays as it is."""
    wanted = [n for n, item in enumerate(glances) if item is not None]
    begun = [
        item.look(anchors, choice.effects)
        for anchors, item in zip(choice.recordings, glances, strict=True)
        if item is not None
    ]
    fits = parallel_fits(lambda i: _separate(begun[i]), [item.model for item in begun], jobs)
    if must_agree(effect_id) and fits:
        agreed = agreed_parameters(fits, effect_id)
        held = [in_line(f, effect_id, agreed) for f in fits]
        fits = parallel_fits(lambda i: settled(*held[i]), [model for model, _ in held], jobs)
    recordings = list(choice.recordings)
    for n, f in zip(wanted, fits, strict=True):
        recordings[n] = (f,)
    return SharedChoice(choice.joint, (*choice.effects, effect_id), tuple(recordings))


def _separate(item: Look) -> Fit:
    begun = polish(item)
    return settled(begun.model, begun.theta)


def with_borrowed_numbers(choice: SharedChoice, jobs: int) -> SharedChoice:
    """Each recording fitted once more from the neighbour whose numbers suit it best.

    The numbers of one rig in two shapes are alike, and a fit by itself may lie in a worse valley.

    Parameters
    ----------
    choice : SharedChoice
    jobs : int
        Processes side by side.

    Returns
    -------
    SharedChoice
        Each recording as given where that was no better.
    """
    recordings = choice.recordings
    begun = [
        min(
            (
                _moved_to(anchors[0], other[0])
                for m, other in enumerate(recordings)
                if m != n and len(other[0].theta) == len(anchors[0].theta)
            ),
            key=lambda b: float(np.sum(b[0].residuals(b[1]) ** 2)),
            default=(anchors[0].model, anchors[0].theta),
        )
        for n, anchors in enumerate(recordings)
    ]
    fits = parallel_fits(lambda i: settled(*begun[i]), [model for model, _ in begun], jobs)
    best = tuple(
        (other,) if score(other) < score(anchors[0]) else anchors
        for anchors, other in zip(recordings, fits, strict=True)
    )
    return replace(choice, recordings=best)


def _moved_to(own: Fit, other: Fit) -> tuple[JointModel, Array]:
    """Another recording's physics, with its numbers, on one's own recording."""
    return replace(other.model, observation=own.model.observation), other.theta
