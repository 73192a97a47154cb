"""Which effects explain several recordings of one rig best together.

A rig whose tube is bent differently from one recording to the next keeps its physics, and only its
parameters change. Explained one by one, two recordings may well be given different names for the
same misfit; the effects are therefore chosen by the sum of the evidence, and fitted together.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from endoscope_core.physics.effects import describe, lacking
from endoscope_explain.decide.given_physics import GivenJoints, GivenPhysics, without_recording
from endoscope_explain.fit.evidence import is_noise, log_evidence, weights
from endoscope_explain.fit.model import Fit, JointModel
from endoscope_explain.fit.nominal import with_references
from endoscope_explain.fit.pooled import fit_together, judged_alone, with_common_numbers
from endoscope_explain.observe.observation import observe, with_held_noise
from endoscope_explain.parallel import parallel_map
from endoscope_explain.pipeline import JointsDifferError, Sources, read_inputs
from endoscope_explain.search.levels import FALSE_ALARMS, STARTS, TRIED
from endoscope_explain.search.null_rigs import NO_DETECTABLE_GAIN, Null, shown
from endoscope_explain.search.refit import TrialFit, candidate, refit, trial_fit
from endoscope_explain.search.repetition import motion_repeats
from endoscope_explain.search.screen import background, by_variant, directions, screened
from endoscope_explain.search.term import Term, Variant, effects

Array = NDArray[np.float64]
ReferenceFits = tuple[Fit, ...]
Begun = tuple[list[JointModel], list[Array]]
"""Models of all recordings, and the coordinates at which their fit begins."""

REFITTED_FIRST, REFITTED = 6, 3
"""Effects that are fitted to all recordings, beside no other one and beside others."""
_SEED = 11


@dataclass(frozen=True)
class SharedChoice:
    """Effects for all recordings of a joint."""

    joint: str
    effects: tuple[str, ...]  # in the order in which they were added
    # Fits of each recording; see `search.refit.trial_fit`. One that has no use for an effect lacks
    # it.
    recordings: tuple[ReferenceFits, ...]

    def total(self) -> float:
        """Sum of the evidence of all recordings."""
        return sum(log_evidence(references[0]) for references in self.recordings)

    def gain_of(self, other: 'SharedChoice') -> float:
        """Gain of evidence from this choice to another."""
        return other.total() - self.total()

    def null(self, jobs: int) -> tuple[float, Null]:
        """What recordings show of one effect more, and rigs in which nothing more is missing."""
        # Gains by the screen of the effect that gains most in all recordings together: one is tried
        # for that serves all of them, and the best of each recording would gain more. Every shape
        # of the tube has a profile of its own, so that what is drawn for one says nothing of
        # another.
        order = np.random.default_rng(_SEED)
        by_recording = [_shown(references[0], order, jobs) for references in self.recordings]
        everywhere = set.intersection(*(set(each) for each in by_recording))
        if not everywhere:
            return 0.0, NO_DETECTABLE_GAIN
        sums = [np.sum([each[effect] for each in by_recording], axis=0) for effect in everywhere]
        largest = np.max(sums, axis=0)
        return float(largest[0]), Null(largest[1:], largest[1:])

    def leaves_noise(self) -> bool:
        """Whether nothing is left to explain in any recording."""
        return all(is_noise(references[0]) for references in self.recordings)


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
        gained[way.term.id] = np.maximum(gained.get(way.term.id, row), row)
    return gained


def with_one_more(choice: SharedChoice, jobs: int) -> list[SharedChoice]:
    """The choice with one more effect, for each of the most promising effects, best first."""
    trials = _trial_fits(choice, jobs)
    variants: dict[str, Variant] = {}
    for variant in sorted(trials, key=lambda v: _logarithm_of_costs(choice, trials[v])):
        variants.setdefault(variant[0], variant)
    promising = list(variants.values())[: REFITTED if choice.effects else REFITTED_FIRST]
    begun = [_begun(choice, trials[variant]) for variant in promising]
    fitted = _side_by_side(begun, jobs, rough=True)
    return sorted(
        (
            SharedChoice(choice.joint, (*choice.effects, variant[0]), recordings)
            for variant, recordings in zip(promising, fitted, strict=True)
        ),
        key=SharedChoice.total,
        reverse=True,
    )


def _effects(found: Fit) -> tuple[Term, ...]:
    """Effects that may be added: what was fitted to one motion is not told from time by another."""
    repeats = motion_repeats(found.model.observation)
    return tuple(
        term for term in effects(found) if repeats or not term.effect.traits.resembles_time
    )


def _trial_fits(choice: SharedChoice, jobs: int) -> dict[Variant, list[TrialFit | None]]:
    """The best cheap fit of each promising variant of an effect, for each recording."""
    trials: dict[Variant, list[TrialFit | None]] = {}
    by_recording = [_effects(references[0]) for references in choice.recordings]
    everywhere = set.intersection(*({t.id for t in terms} for terms in by_recording))
    for n, (references, own_terms) in enumerate(zip(choice.recordings, by_recording, strict=True)):
        behind = background(references[0])
        offset = behind.offset
        terms = tuple(t for t in own_terms if t.id in everywhere)
        variants = by_variant(screened(behind, directions(behind, terms, jobs)))
        tasks = [term for own in variants[:TRIED] for term in own[:STARTS]]

        def tried(
            term: Term, references: ReferenceFits = references, offset: Array = offset
        ) -> TrialFit:
            return trial_fit(references, term, offset)

        for item in parallel_map(tried, tasks, jobs):
            found = trials.setdefault(item.term.variant, [None] * len(choice.recordings))
            before = found[n]
            if before is None or item.cost < before.cost:
                found[n] = item
    return trials


def _logarithm_of_costs(choice: SharedChoice, trials: list[TrialFit | None]) -> float:
    return sum(
        math.log(_cost(references[0]) if item is None else min(item.cost, _cost(references[0])))
        for references, item in zip(choice.recordings, trials, strict=True)
    )


def _cost(found: Fit) -> float:
    """Half the squares of a fit, weighted as those of a trial fit beside it are."""
    weighted = found.residuals * weights(found.model.observation, found.residuals)
    return found.model.cost(weighted, found.theta)


def _begun(choice: SharedChoice, trials: list[TrialFit | None]) -> Begun:
    """Models of all recordings with one more effect, and where their fit begins."""
    # A recording that has no use for the effect stays without it.
    models, starts = [], []
    for references, item in zip(choice.recordings, trials, strict=True):
        found = references[0] if item is None else refit(item, candidate((), references[0])).fit
        models.append(found.model)
        starts.append(found.theta)
    return models, starts


def settled_together(choices: Sequence[SharedChoice], jobs: int) -> list[SharedChoice]:
    """Choices fitted until nothing moves any more, also from where all recordings are alike."""
    # A fit by itself may lie in another valley than those of the same rig in other shapes.
    twice: list[SharedChoice] = []
    begun: list[Begun] = []
    for choice in choices:
        own = [references[0] for references in choice.recordings]
        for starts in ([f.theta for f in own], with_common_numbers(own)):
            twice.append(choice)
            begun.append(([f.model for f in own], starts))
    best: dict[frozenset[str], SharedChoice] = {}
    for choice, recordings in zip(twice, _side_by_side(begun, jobs, rough=False), strict=True):
        found = replace(choice, recordings=recordings)
        key = frozenset(choice.effects)
        best[key] = max(best.get(key, found), found, key=SharedChoice.total)
    return sorted(best.values(), key=SharedChoice.total, reverse=True)


def _side_by_side(
    begun: Sequence[Begun], jobs: int, *, rough: bool
) -> list[tuple[ReferenceFits, ...]]:
    found = parallel_map(lambda task: fit_together(*task, rough=rough), begun, jobs)
    return [tuple((f,) for f in fits) for fits in found]


BEAM = 3
"""Choices of effects that are kept at each step (beam search)."""


def physics_of_all(
    sources: Sequence[Sources], jobs: int, tell: Callable[[str], None]
) -> list[GivenJoints]:
    """Effects that explain all recordings of a rig; BagError if one cannot be used."""
    recordings: list[dict[str, ReferenceFits]] = []
    with threadpool_limits(1, 'blas'):
        for one in sources:
            inputs = read_inputs(one)
            recording = inputs.audit.recording
            tell(f'{recording.name}: refitting the nominal plant')
            _, references = with_references(
                recording,
                with_held_noise(observe(recording, inputs.plant)),
                inputs.plant,
                one.band,
                jobs,
            )
            joints = recording.joints
            if recordings and set(joints) != set(recordings[0]):
                raise JointsDifferError(
                    f'{one.bag}: has {", ".join(joints)}, but {sources[0].bag} has '
                    f'{", ".join(recordings[0])}'
                )
            recordings.append(dict(zip(joints, references, strict=True)))
        return shared_effects(recordings, sources[0].most_effects, jobs, tell)


def shared_effects(
    recordings: Sequence[Mapping[str, ReferenceFits]],
    most_effects: int,
    jobs: int,
    tell: Callable[[str], None],
) -> list[GivenJoints]:
    """Choose effects for all recordings of a rig by the nominal fits of each joint."""
    given: list[dict[str, GivenPhysics]] = [{} for _ in recordings]
    for joint in recordings[0]:
        nominal = SharedChoice(joint, (), tuple(references[joint] for references in recordings))
        chosen, _ = searched(nominal, most_effects, jobs, tell)
        alone = judged_alone([references[0] for references in chosen.recordings])
        for physics, found in zip(given, alone, strict=True):
            own = tuple(e for e in chosen.effects if found.model.flags[describe(e).flag])
            physics[joint] = without_recording(own, found)
    return list(given)


def searched(
    nominal: SharedChoice, most_effects: int, jobs: int, tell: Callable[[str], None]
) -> tuple[SharedChoice, SharedChoice | None]:
    """Effects added one by one to the best few choices, and the choice that was refused."""
    # The best single effect may mislead; another form may gain as much as the refused one.
    best, beam = nominal, [nominal]
    most_effects += len(lacking(nominal.recordings[0][0].model.base))
    while len(best.effects) < most_effects:
        if best.leaves_noise():
            tell(f'{nominal.joint}: only noise is left beside {_listed(best)}')
            break
        grown: dict[frozenset[str], SharedChoice] = {}
        for choice in beam:
            tell(f'{nominal.joint}: what all recordings lack beside {_listed(choice)}')
            for found in with_one_more(choice, jobs):
                key = frozenset(found.effects)
                grown[key] = max(found, grown.get(key, found), key=SharedChoice.total)
        chosen = sorted(grown.values(), key=SharedChoice.total, reverse=True)[:BEAM]
        beam = settled_together(chosen, jobs)
        if not beam:
            break
        gain = best.gain_of(beam[0])
        shown, null = best.null(jobs)
        chance = null.p_value(shown)
        if chance > FALSE_ALARMS:
            tell(
                f'{nominal.joint}: not {_listed(beam[0])}: better by {gain:.0f} nats, but '
                f'{chance:.1%} of rigs without it show as much'
            )
            return best, beam[0]
        tell(f'{nominal.joint}: {_listed(beam[0])}, better by {gain:.0f} nats')
        best = beam[0]
    return best, None


def _listed(choice: SharedChoice) -> str:
    return ', '.join(choice.effects) or 'nothing'
