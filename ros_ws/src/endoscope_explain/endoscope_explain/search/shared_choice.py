"""One set of effects for several recordings of a rig, and the sets with one effect more.

The sum of the evidence decides; all recordings are fitted together, see `fit.pooled`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit.evidence import log_evidence, weights
from endoscope_explain.fit.model import Fit, JointModel
from endoscope_explain.fit.pooled import fit_together, with_common_numbers
from endoscope_explain.fit.whiteness import is_noise
from endoscope_explain.parallel import parallel_map
from endoscope_explain.search.candidate import Candidate, Variant, effects
from endoscope_explain.search.levels import LOOKED_AT, STARTS
from endoscope_explain.search.null_rigs import NOTHING_SHOWN, Null, shown
from endoscope_explain.search.refit import Look, composition, look, polish
from endoscope_explain.search.repeated_motion import motion_repeats
from endoscope_explain.search.screen import background, directions, promises

Array = NDArray[np.float64]
Anchors = tuple[Fit, ...]
Begun = tuple[list[JointModel], list[Array]]
"""Models of all recordings, and the coordinates at which their fit begins."""

POLISHED_FIRST, POLISHED = 6, 3
"""Effects that are fitted to all recordings, beside no other one and beside others."""
_SEED = 11
_TINY = 1e-12


@dataclass(frozen=True)
class SharedChoice:
    """Effects for all recordings of a joint.

    `effects`: in the order in which they were added.
    `recordings`: fits of each recording; see `search.refit.look`. One that has no use for an effect
        lacks it.
    """

    joint: str
    effects: tuple[str, ...]
    recordings: tuple[Anchors, ...]

    def total(self) -> float:
        """Sum of the evidence of all recordings."""
        return sum(log_evidence(anchors[0]) for anchors in self.recordings)

    def gain_of(self, other: 'SharedChoice') -> float:
        """Gain of evidence from this choice to another."""
        return other.total() - self.total()

    def null(self, jobs: int) -> tuple[float, Null]:
        """What recordings show of one effect more, and rigs in which nothing more is missing.

        Returns: gains by the screen of the effect that gains most in all recordings together: one
            is looked for that serves all of them, and the best of each recording would gain more.
            Every shape of the tube has a profile of its own, so that what is drawn for one says
            nothing of another.
        """
        order = np.random.default_rng(_SEED)
        by_recording = [_shown(anchors[0], order, jobs) for anchors in self.recordings]
        everywhere = set.intersection(*(set(each) for each in by_recording))
        if not everywhere:
            return 0.0, NOTHING_SHOWN
        sums = [np.sum([each[effect] for each in by_recording], axis=0) for effect in everywhere]
        largest = np.max(sums, axis=0)
        return float(largest[0]), Null(largest[1:], largest[1:])

    def leaves_noise(self) -> bool:
        """Whether nothing is left to explain in any recording."""
        return all(is_noise(anchors[0]) for anchors in self.recordings)


def _shown(found: Fit, order: np.random.Generator, jobs: int) -> dict[str, Array]:
    """Gains (1 + B,) of each effect: on the recording, and on rigs in any order."""
    behind = background(found)
    ways = directions(behind, _effects(found), jobs)
    if not ways:
        return {}
    screened = shown(behind, ways, None, jobs)
    drawn = screened.drawn[:, order.permutation(screened.drawn.shape[1])]
    gained: dict[str, Array] = {}
    for way, row in zip(ways, np.column_stack([screened.observed, drawn]), strict=True):
        gained[way.candidate.id] = np.maximum(gained.get(way.candidate.id, row), row)
    return gained


def with_one_more(choice: SharedChoice, jobs: int) -> list[SharedChoice]:
    """The choice with one more effect, for each of the most promising effects.

    Returns: best first.
    """
    looks = _looks(choice, jobs)
    variants: dict[str, Variant] = {}
    for variant in sorted(looks, key=lambda v: _logarithm_of_costs(choice, looks[v])):
        variants.setdefault(variant[0], variant)
    promising = list(variants.values())[: POLISHED if choice.effects else POLISHED_FIRST]
    begun = [_begun(choice, looks[variant]) for variant in promising]
    fitted = _side_by_side(begun, jobs, rough=True)
    return sorted(
        (
            SharedChoice(choice.joint, (*choice.effects, variant[0]), recordings)
            for variant, recordings in zip(promising, fitted, strict=True)
        ),
        key=SharedChoice.total,
        reverse=True,
    )


def _effects(found: Fit) -> tuple[Candidate, ...]:
    """Effects that may be added: what was fitted to one motion is not told from time by another."""
    repeats = motion_repeats(found.model.observation)
    return tuple(term for term in effects(found) if repeats or not term.term.traits.resembles_time)


def _looks(choice: SharedChoice, jobs: int) -> dict[Variant, list[Look | None]]:
    """The best cheap fit of each promising variant of an effect, for each recording."""
    looks: dict[Variant, list[Look | None]] = {}
    everywhere = set.intersection(
        *({t.id for t in _effects(anchors[0])} for anchors in choice.recordings)
    )
    for n, anchors in enumerate(choice.recordings):
        behind = background(anchors[0])
        offset = behind.offset
        terms = tuple(t for t in _effects(anchors[0]) if t.id in everywhere)
        starts: dict[Variant, list[Candidate]] = {}
        for promised in promises(behind, directions(behind, terms, jobs)):
            starts.setdefault(promised.candidate.variant, []).append(promised.candidate)
        tasks = [term for own in list(starts.values())[:LOOKED_AT] for term in own[:STARTS]]

        def looked(term: Candidate, anchors: Anchors = anchors, offset: Array = offset) -> Look:
            return look(anchors, term, offset)

        for item in parallel_map(looked, tasks, jobs):
            found = looks.setdefault(item.candidate.variant, [None] * len(choice.recordings))
            before = found[n]
            if before is None or item.cost < before.cost:
                found[n] = item
    return looks


def _logarithm_of_costs(choice: SharedChoice, looks: list[Look | None]) -> float:
    return sum(
        math.log(_cost(anchors[0]) if item is None else min(item.cost, _cost(anchors[0])))
        for anchors, item in zip(choice.recordings, looks, strict=True)
    )


def _cost(found: Fit) -> float:
    """Half the squares of a fit, weighted as those of a first look beside it are."""
    weighted = found.residuals * weights(found.model.observation, found.residuals)
    return found.model.cost(weighted, found.theta)


def _begun(choice: SharedChoice, looks: list[Look | None]) -> Begun:
    """Models of all recordings with one more effect, and where their fit begins.

    A recording that has no use for the effect stays without it.
    """
    models, starts = [], []
    for anchors, item in zip(choice.recordings, looks, strict=True):
        found = anchors[0] if item is None else polish(item, composition((), anchors[0])).fit
        models.append(found.model)
        starts.append(found.theta)
    return models, starts


def settled_together(choices: Sequence[SharedChoice], jobs: int) -> list[SharedChoice]:
    """Choices fitted until nothing moves any more, also from where all recordings are alike.

    A fit by itself may lie in another valley than those of the same rig in other shapes.

    Returns: best first.
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
        best[key] = max(best.get(key, found), found, key=SharedChoice.total)
    return sorted(best.values(), key=SharedChoice.total, reverse=True)


def _side_by_side(begun: Sequence[Begun], jobs: int, *, rough: bool) -> list[tuple[Anchors, ...]]:
    found = parallel_map(lambda task: fit_together(*task, rough=rough), begun, jobs)
    return [tuple((f,) for f in fits) for fits in found]
