"""From the compositions tried on one joint to what is said about it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.compose import Composition
from endoscope_explain.fit.intervals import may_be_absent
from endoscope_explain.fit.score import NEARLY_NOISE, PARAMETER_PRICE
from endoscope_explain.fit.whiteness import is_noise, slips, worst_against_raw_noise
from endoscope_explain.search import JointSearch

NAMED = 20.0
"""Fall of the score that a first effect must bring; noise alone brings a few."""
ADDED = 30.0
"""Fall of the score that a further effect must bring."""
ADDED_SHARE = 0.25
"""Share of the fall so far that a second effect must bring: less is an error of form. Third ones
and more are looked for only where they were asked for."""
ADDED_SHARE_TO_NOISE = 0.08
"""The same where hardly more than noise is left then: no error of form looks just like another
effect."""
HARDLY_MORE = 0.1
"""Share of what the first effect left above noise up to which that is so."""
EXPLAINED = 0.68
"""Share of the misfit's logarithm that the catalogue must explain to be called adequate."""
BARELY = 0.2
"""Share below which a name would mislead: the physics is another one, and none is named."""
EXPLAINED_IN_SLIPS = 0.25
"""The same where wires stick and slip: the instant of a slip is nobody's to predict."""
LIKE_RAW_NOISE = 1.12
"""Rmse over noise of raw samples up to which an improved plant predicts as well as anyone needs."""
RIVAL = 25.0
"""Score within which another effect in the same place cannot be told apart."""
RIVAL_SHARE = 0.08
"""The same as a share of the fall that the effect brings: errors of form blur the ranking."""


@dataclass(frozen=True)
class Decision:
    """What is said about one joint.

    Attributes
    ----------
    chosen : Composition
        Named effects; none for the nominal plant.
    adequate : bool
        Whether the chosen plant leaves noise or a small error of form.
    explained : float
        Share of the excess score that the chosen composition removes; 1 where none was there.
    alternatives : dict of effect id to tuple of str
        Rivals of each chosen effect, nearest first.
    margins, gaps : dict of effect id to float
        Score lost without the effect, and with the best rival in its place.
    """

    chosen: Composition
    adequate: bool
    explained: float
    alternatives: dict[str, tuple[str, ...]]
    margins: dict[str, float]
    gaps: dict[str, float]


def decide(search: JointSearch) -> Decision:
    """Choose a composition, judge whether it is adequate, and list its rivals."""
    nominal = search.nominal
    chosen = nominal
    if not is_noise(nominal.fit):
        for level in search.levels:
            better = _better(chosen, nominal, level)
            if better is None:
                break
            chosen = better
    above = nominal.above_noise()
    if (
        chosen.effects
        and not is_noise(chosen.fit)
        and (nominal.score - chosen.score < BARELY * above)
    ):
        chosen = nominal
    chosen = _without_absent(search, chosen)
    if search.beyond is not None and _does_as_much(search.beyond, chosen):
        chosen = search.beyond
    left = chosen.above_noise()
    explained = 1.0 if above <= 0.0 or is_noise(chosen.fit) else 1.0 - left / above
    adequate = (
        is_noise(chosen.fit)
        or left < NEARLY_NOISE
        or (bool(chosen.effects) and worst_against_raw_noise(chosen.fit) < LIKE_RAW_NOISE)
        or (
            bool(chosen.effects)
            and explained
            >= (EXPLAINED_IN_SLIPS if slips(chosen.fit.model.observation) else EXPLAINED)
        )
    )
    margins, gaps, alternatives = {}, {}, {}
    tried = search.tried()
    measure = _likelihood if is_noise(chosen.fit) else _score
    best = measure(chosen)
    for effect_id in chosen.effects:
        rest = frozenset(chosen.effects) - {effect_id}
        without = [measure(c) for c in tried if frozenset(c.effects) == rest]
        margins[effect_id] = min(without, default=measure(nominal)) - best
        rivals = sorted(
            (measure(c) - best, next(iter(frozenset(c.effects) - rest)))
            for c in tried
            if len(c.effects) == len(chosen.effects)
            and rest < frozenset(c.effects)
            and effect_id not in c.effects
        )
        gaps[effect_id] = min(rivals[0][0] if rivals else np.inf, margins[effect_id])
        reach = RIVAL if measure is _likelihood else max(RIVAL, RIVAL_SHARE * margins[effect_id])
        alternatives[effect_id] = tuple(name for gap, name in rivals if gap < reach)
    return Decision(chosen, adequate, explained, alternatives, margins, gaps)


def _without_absent(search: JointSearch, chosen: Composition) -> Composition:
    """What is left of a composition without effects whose strength may as well be nothing."""
    for effect_id in chosen.effects:
        if may_be_absent(chosen.fit, CATALOGUE[effect_id]):
            rest = frozenset(chosen.effects) - {effect_id}
            fewer = [c for c in search.tried() if frozenset(c.effects) == rest]
            best = min(fewer, key=lambda c: c.score, default=search.nominal)
            return _without_absent(search, best)
    return chosen


def with_devices_agreed(
    searches: Sequence[JointSearch], decisions: Sequence[Decision]
) -> list[Decision]:
    """Let the joints agree about the device that reads them all.

    Where one joint shows beyond doubt that the tracker or its clock is late, and another joint's
    effect might as well be that, it is that.

    Parameters
    ----------
    searches, decisions : sequence
        One for each joint.

    Returns
    -------
    list of Decision
    """
    certain = {
        effect_id
        for decision in decisions
        for effect_id in decision.chosen.effects
        if CATALOGUE[effect_id].traits.of_device and not decision.alternatives[effect_id]
    }
    return [
        _agreed(search, decision, certain)
        for search, decision in zip(searches, decisions, strict=True)
    ]


def _agreed(search: JointSearch, decision: Decision, certain: set[str]) -> Decision:
    for effect_id in decision.chosen.effects:
        for rival in decision.alternatives[effect_id]:
            effects = frozenset(decision.chosen.effects) - {effect_id} | {rival}
            found = [c for c in search.tried() if frozenset(c.effects) == effects]
            if rival in certain and found:
                return replace(
                    decision,
                    chosen=found[0],
                    alternatives=decision.alternatives | {rival: ()},
                    margins=decision.margins | {rival: decision.margins[effect_id]},
                    gaps=decision.gaps | {rival: decision.margins[effect_id]},
                )
    return decision


def _score(composition: Composition) -> float:
    return composition.score


def _likelihood(composition: Composition) -> float:
    """Half deviance under the known noise: right where nothing but noise is left."""
    return composition.fit.cost + PARAMETER_PRICE * len(composition.fit.theta)


def _does_as_much(beyond: Composition, chosen: Composition) -> bool:
    """Return whether nominal numbers beyond their band do what the chosen plant does."""
    if is_noise(chosen.fit):
        return is_noise(beyond.fit) and _likelihood(beyond) < _likelihood(chosen) + NAMED
    return beyond.score < chosen.score + (NAMED if chosen.effects else -NAMED)


def _better(
    chosen: Composition, nominal: Composition, level: tuple[Composition, ...]
) -> Composition | None:
    so_far = nominal.score - chosen.score
    alike = [c for c in level if is_noise(c.fit)]
    left = HARDLY_MORE * chosen.above_noise() if chosen.effects else 0.0
    like_noise = alike or any(c.above_noise() < left for c in level)
    share = ADDED_SHARE_TO_NOISE if like_noise else ADDED_SHARE
    if len(chosen.effects) > 1:
        share = 0.0
    needed = max(ADDED, share * so_far) if chosen.effects else NAMED
    candidates = sorted(alike, key=_likelihood) if alike else level
    for candidate in candidates:
        if candidate.score < chosen.score - needed or (
            not chosen.effects and alike and _likelihood(candidate) < _likelihood(chosen) - needed
        ):
            return candidate
    return None
