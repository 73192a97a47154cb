"""From what was tried on one joint to what is said about it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit

from endoscope_core.physics.effects import CATALOGUE, KNOWN
from endoscope_explain.criteria import BEYOND_FORM, CERTAINTY
from endoscope_explain.fit.intervals import may_be_absent, with_form
from endoscope_explain.search.levels import JointSearch, Level
from endoscope_explain.search.refit import Candidate
from endoscope_explain.search.term import Term

Array = NDArray[np.float64]


def features(gain: float, margin: float, beyond_form: float) -> tuple[float, float, float]:
    """What the certainty of a name is judged by."""
    # One; the share `margin / gain` of its evidence that no other name has; and by how much what is
    # left exceeds what rigs of another form leave, as a logarithm. In the study of forms that
    # differ, names whose next rival had less than half of their gain were right in 27 cases of 28,
    # and what was left told right from wrong in 44 of 48.
    alone = min(max(margin / gain, 0.0), 1.0) if gain > 0.0 else 0.0
    left = 0.0 if math.isnan(beyond_form) else math.log(max(beyond_form, 1.0))
    return 1.0, alone, left


def probability(named: ArrayLike, weights: Sequence[float]) -> Array:
    """Probability (m,) that names are right, by their features (m, 3) and the weights of these."""
    return np.asarray(expit(np.asarray(named, dtype=float) @ np.asarray(weights)))


def certainty(gain: float, margin: float, beyond_form: float) -> float:
    """Probability that a name is right, as it was measured on rigs whose truth is known."""
    return float(probability([features(gain, margin, beyond_form)], CERTAINTY)[0])


@dataclass(frozen=True)
class MissingTerm:
    """One term that is missing from the simulation."""

    term: Term  # as it is modelled
    # Effect of the catalogue whose physics it is; the place of the function where it is none's.
    name: str
    # Names of terms that the recording does not tell from it, nearest first.
    alternatives: tuple[str, ...]
    gain: float  # logarithm of the evidence that it brings
    margin: float  # by how much more than the best other name
    p_value: float  # chance that a rig in which nothing is missing shows as much
    formula: Candidate | None  # with the formula of `name`, where it was fitted
    form: float = 0.0  # evidence in nats by which an error of form may mislead between names

    @property
    def is_known(self) -> bool:
        """Whether it is an effect of the catalogue."""
        return self.name in KNOWN


@dataclass(frozen=True)
class Decision:
    """What is said about one joint."""

    chosen: Candidate  # the joint with what is missing; the nominal plant where nothing is
    missing: tuple[MissingTerm, ...]  # in the order in which they were found
    explained: float  # share of the excess misfit that the terms remove; 1 where there was none
    # Names of terms that the recording does not tell from other numbers, nearest first.
    instead: tuple[str, ...] = ()

    @property
    def beyond_form(self) -> float:
        """What the chosen plant leaves over what another form leaves; see `Fit`."""
        return self.chosen.fit.beyond_form or 0.0

    @property
    def adequate(self) -> bool:
        """Whether the chosen plant leaves noise, or no more than another form would."""
        return self.beyond_form <= BEYOND_FORM


def decide(search: JointSearch, jobs: int) -> Decision:
    """Choose a candidate, name its terms and their rivals, and judge whether it is adequate."""
    chosen: Candidate = search.nominal
    missing: tuple[MissingTerm, ...] = ()
    instead: tuple[str, ...] = ()
    for level in search.levels:
        if not level.is_found:
            break
        best = level.best
        if level.adds_nothing(best):
            chosen, instead = best, _instead(level)
            continue
        best = _with_form(best, jobs)
        if any(not t.is_function and may_be_absent(best.fit, t.effect) for t in best.terms):
            break
        chosen, instead = best, ()
        if not best.terms[-1].multiplies:
            missing = (*missing[: len(best.terms) - 1], _missing(level, best, jobs))
    missing = _named_as_chosen(search, chosen, missing, jobs)
    chosen = _with_form(chosen, jobs)
    return Decision(chosen, missing, share_explained(search.nominal, chosen), instead)


def found_together(search: JointSearch, jobs: int) -> tuple[MissingTerm, ...]:
    """The effects that several recordings of a rig lack, each with the rivals that all leave."""
    missing: tuple[MissingTerm, ...] = ()
    for level in takewhile(lambda each: each.is_found, search.levels):
        if not level.adds_nothing(level.best):
            missing = (*missing[: len(level.best.terms) - 1], _missing(level, level.best, jobs))
    return _named_as_chosen(search, search.found, missing, jobs)


def _with_form(one: Candidate, jobs: int) -> Candidate:
    return replace(one, fits=(with_form(one.fit, jobs),))


def share_explained(nominal: Candidate, chosen: Candidate) -> float:
    """Share of the misfit above noise that a candidate removes; 1 where there was none."""
    before, after = (float(np.sum(one.fit.residuals**2)) for one in (nominal, chosen))
    above = before - nominal.fit.model.observation.size
    return 1.0 if above <= 0.0 else float(np.clip((before - after) / above, 0.0, 1.0))


def _instead(level: Level) -> tuple[str, ...]:
    """Terms that explain as much as other numbers do."""
    others = [c for c in level.found if not level.adds_nothing(c)]
    near = [c for c in others if level.judge.stands_for(c, level.best)]
    return tuple(dict.fromkeys(_name(level, each) for each in near))


def _missing(level: Level, best: Candidate, jobs: int) -> MissingTerm:
    last = best.terms[-1]
    formulas = [c for c in level.at_the_place_of(best) if not c.terms[-1].is_function]
    formula = best if not last.is_function else (formulas[0] if formulas else None)
    name = _name(level, best)
    gain = level.gain(best)
    beside = [t.id for t in best.terms[:-1]]
    others = [
        each
        for each in level.found
        if each.terms and [t.id for t in each.terms[:-1]] == beside and _name(level, each) != name
    ]
    rivals = level.rivals()
    near = [_name(level, each) for each in others if any(each is rival for rival in rivals)]
    alternatives = tuple(dict.fromkeys(near))
    best_other = max((level.gain(each) for each in others), default=0.0)
    if formula is not None and formula is not best:
        formula = _with_form(formula, jobs)
        if may_be_absent(formula.fit, formula.terms[-1].effect):
            # The function is there; the effect whose formula comes nearest may not be.
            name, formula = last.id, None
    margin = gain - max(best_other, 0.0)
    return MissingTerm(
        last, name, alternatives, gain, margin, level.p_value, formula, level.judge.form_is_worth
    )


def _name(level: Level, one: Candidate) -> str:
    """The effect whose physics the last term of a candidate is, or its place."""
    # At the place of a function it is the effect whose formula comes nearest, or the only one
    # there.
    last = one.terms[-1]
    if not last.is_function:
        return last.id
    formulas = [c for c in level.at_the_place_of(one) if not c.terms[-1].is_function]
    if formulas:
        return formulas[0].terms[-1].id
    there = [e.id for e in CATALOGUE.values() if last.id in e.traits.families]
    return there[0] if len(there) == 1 else last.id


def _named_as_chosen(
    search: JointSearch, chosen: Candidate, missing: tuple[MissingTerm, ...], jobs: int
) -> tuple[MissingTerm, ...]:
    """The missing terms as chosen: a rival of the first one may have led to a better two."""
    named = []
    adding = [level for level in search.levels if not level.adds_nothing(level.best)]
    for position, term in enumerate(chosen.terms):
        if term.multiplies:
            continue
        if position < len(missing) and missing[position].term.id == term.id:
            named.append(missing[position])
            continue
        level = adding[position]
        own = [c for c in level.found if c.terms and c.terms[-1].id == term.id]
        named.append(_missing(level, own[0], jobs))
    # What is missing besides is no other name of it.
    names = {term.name for term in named}
    return tuple(
        replace(term, alternatives=tuple(a for a in term.alternatives if a not in names))
        for term in named
    )
