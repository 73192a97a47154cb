"""One set of effects for several recordings of a rig, and the sets with one effect more.

The sum of all scores decides; all recordings are fitted together, see `shared_fit`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.compose import searchable_effects
from endoscope_explain.fit.model import Fit, JointModel
from endoscope_explain.fit.pooled import fit_together, with_common_numbers
from endoscope_explain.fit.score import score
from endoscope_explain.fit.whiteness import is_noise
from endoscope_explain.parallel import parallel_map
from endoscope_explain.rank import Look, look, polish
from endoscope_explain.repeated_motion import DEPENDS_ON_TIME, motion_repeats
from endoscope_explain.screen import Promise, promises, unexplained

Array = NDArray[np.float64]
Anchors = tuple[Fit, ...]
Begun = tuple[list[JointModel], list[Array]]
"""Models of all recordings, and the coordinates at which their fit begins."""
Variant = tuple[str, tuple[float, ...]]
"""An effect, and what it acts on or which of its forms it has, which no shape of a tube changes."""

LIKE_TIME = DEPENDS_ON_TIME | {e.id for e in CATALOGUE.values() if e.traits.resembles_time}
"""Effects that a motion made only once does not tell from a change with time: wires that go on
stretching for seconds look like a sensor that drifts."""
STARTS = 2
"""Starting points of an effect that get a cheap fit."""
POLISHED_FIRST, POLISHED = 6, 3
"""Effects that are fitted to all recordings, beside no other one and beside others."""


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
        Tasks side by side.

    Returns
    -------
    list of SharedChoice
        Best first.
    """
    looks = _looks(choice, jobs)
    variants: dict[str, Variant] = {}
    for variant in sorted(looks, key=lambda v: _logarithm_of_costs(choice, looks[v])):
        variants.setdefault(variant[0], variant)
    promising = list(variants.values())[: POLISHED if choice.effects else POLISHED_FIRST]
    begun = [_begun(choice, variant[0], looks[variant]) for variant in promising]
    fitted = _side_by_side(begun, jobs, rough=True)
    return sorted(
        (
            SharedChoice(choice.joint, (*choice.effects, variant[0]), recordings)
            for variant, recordings in zip(promising, fitted, strict=True)
        ),
        key=SharedChoice.total,
    )


def _looks(choice: SharedChoice, jobs: int) -> dict[Variant, list[Look | None]]:
    """The best cheap fit of each promising variant of an effect, for each recording."""
    recordings = choice.recordings
    repeated = all(motion_repeats(anchors[0].model.observation) for anchors in recordings)
    tasks = [
        (e, n)
        for e in searchable_effects()
        if e not in choice.effects and (repeated or e not in LIKE_TIME)
        for n in range(len(recordings))
    ]
    left = [unexplained(anchors[0]) for anchors in recordings]

    def looked(task: tuple[str, int]) -> dict[Variant, Look]:
        effect_id, n = task
        starts: dict[Variant, list[Promise]] = {}
        for promise in promises(left[n], effect_id):
            starts.setdefault(_variant(promise), []).append(promise)
        return {
            variant: min(
                (look(recordings[n], choice.effects, start) for start in own[:STARTS]),
                key=lambda item: item.cost,
            )
            for variant, own in starts.items()
        }

    looks: dict[Variant, list[Look | None]] = {}
    for (_, n), found in zip(tasks, parallel_map(looked, tasks, jobs), strict=True):
        for variant, item in found.items():
            looks.setdefault(variant, [None] * len(recordings))[n] = item
    return looks


def _variant(promise: Promise) -> Variant:
    parameters = CATALOGUE[promise.effect_id].parameters
    return promise.effect_id, tuple(promise.start[p.name] for p in parameters if p.choices)


def _logarithm_of_costs(choice: SharedChoice, looks: list[Look | None]) -> float:
    return sum(
        math.log(anchors[0].cost if item is None else min(item.cost, anchors[0].cost))
        for anchors, item in zip(choice.recordings, looks, strict=True)
    )


def _begun(choice: SharedChoice, effect_id: str, looks: list[Look | None]) -> Begun:
    """Models of all recordings with one more effect, and where their fit begins.

    A recording that has no use for the effect stays without it.
    """
    models, starts = [], []
    for anchors, item in zip(choice.recordings, looks, strict=True):
        found = anchors[0] if item is None else polish(item)
        models.append(found.model)
        starts.append(found.theta)
    return models, starts


def settled_together(choices: Sequence[SharedChoice], jobs: int) -> list[SharedChoice]:
    """Choices fitted until nothing moves any more, also from where all recordings are alike.

    A fit by itself may lie in another valley than those of the same rig in other shapes.

    Parameters
    ----------
    choices : sequence of SharedChoice
    jobs : int
        Tasks side by side.

    Returns
    -------
    list of SharedChoice
        Best first.
    """
    twice: list[SharedChoice] = []
    begun: list[Begun] = []
    for choice in choices:
        own = [anchors[0] for anchors in choice.recordings]
        for starts in ([f.theta for f in own], with_common_numbers(own)):
            twice.append(choice)
            begun.append(([f.model for f in own], starts))
    best: dict[frozenset[str], SharedChoice] = {}
    for choice, recordings in zip(twice, _side_by_side(begun, jobs, rough=False), strict=True):
        found = replace(choice, recordings=recordings)
        key = frozenset(choice.effects)
        best[key] = min(best.get(key, found), found, key=SharedChoice.total)
    return sorted(best.values(), key=SharedChoice.total)


def _side_by_side(begun: Sequence[Begun], jobs: int, *, rough: bool) -> list[tuple[Anchors, ...]]:
    found = parallel_map(lambda task: fit_together(*task, rough=rough), begun, jobs)
    return [tuple((f,) for f in fits) for fits in found]
