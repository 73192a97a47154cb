"""From what was tried on one joint, or was chosen elsewhere, to what is concluded of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import takewhile

import numpy as np
from scipy.stats import chi2

from endoscope_core.physics.effects import CATALOGUE, KNOWN
from endoscope_core.workers import parallel_map
from endoscope_explain.criteria import BEYOND_FORM
from endoscope_explain.fit.evidence import log_evidence
from endoscope_explain.fit.family import Family
from endoscope_explain.fit.free_parameters import FreeParameter
from endoscope_explain.fit.intervals import may_be_absent, with_form
from endoscope_explain.fit.model import TO_THE_END, Fit, JointModel, fit, without_effect
from endoscope_explain.prediction_set import OTHER_NUMBERS, Contest
from endoscope_explain.recording import Array, Mask
from endoscope_explain.search.levels import JointSearch, Level, search
from endoscope_explain.search.refit import SETTLED, Candidate, candidate
from endoscope_explain.search.term import Term

SAME = 0.95
"""Chance with which noise alone moves two fits of one law apart by less, so that they are one."""


@dataclass(frozen=True)
class MissingTerm:
    """One term that is missing from the simulation."""

    term: Term  # as it is modelled
    # Effect of the catalogue whose physics it is; the place of the function where it is none's.
    name: str
    contest: Contest  # names that were tried in its place
    gain: float  # logarithm of the evidence that it brings
    margin: float  # by how much more than the best other name
    p_value: float  # chance that a rig in which nothing is missing shows as much
    formula: Candidate | None  # with the formula of `name`, where it was fitted
    # A function that repairs what another form leaves: the plant has it, and it is no finding.
    repairs_form: bool = False

    @property
    def is_known(self) -> bool:
        """Whether it is an effect of the catalogue."""
        return self.name in KNOWN


@dataclass(frozen=True)
class Decision:
    """What is concluded of one joint."""

    chosen: Candidate  # the joint with what is missing; the nominal plant where nothing is
    missing: tuple[MissingTerm, ...]  # in the order in which they were found
    explained: float  # share of the excess misfit that the terms remove; 1 where there was none
    # Names that were tried for what else might be missing; None where only noise is left.
    open: Contest | None = None
    repairs: tuple[str, ...] = ()  # functions that are no finding; see `MissingTerm.repairs_form`

    @property
    def beyond_form(self) -> float:
        """What the chosen plant leaves over what another form leaves; see `Fit`."""
        return self.chosen.fit.beyond_form or 0.0

    @property
    def adequate(self) -> bool:
        """Whether the chosen plant leaves noise, or no more than another form would."""
        return _is_adequate(self.chosen)


def _is_adequate(one: Candidate) -> bool:
    return (one.fit.beyond_form or 0.0) <= BEYOND_FORM


def decide(tried: JointSearch, jobs: int) -> Decision:
    """Choose a candidate, name its terms and their rivals, and judge whether it is adequate."""
    chosen: Candidate = tried.nominal
    missing: tuple[MissingTerm, ...] = ()
    left: Contest | None = None
    for level in tried.levels:
        left = _contest(level, chosen.terms)
        if not level.is_found:
            break
        best = level.best
        if level.adds_nothing(best):
            chosen = best
            continue
        best = _with_form(best, jobs)
        if any(not t.is_function and may_be_absent(best.fit, t.effect) for t in best.terms):
            break
        before, chosen = chosen, best
        if best.terms[-1].multiplies:
            left = None
            continue
        term = _missing(level, best, jobs)
        # What leaves noise alone is what is missing. Else a function of no name repairs any form:
        # where no more was left than another form leaves, nothing is.
        unnamed = not (term.is_known or best.is_noise)
        form = unnamed and _is_adequate(_with_form(before, jobs))
        left = left if form else None
        missing = (*missing[: len(best.terms) - 1], replace(term, repairs_form=form))
    missing = _named_as_chosen(tried, chosen, missing, jobs)
    repairs = tuple(term.term.id for term in missing if term.repairs_form)
    missing = tuple(term for term in missing if not term.repairs_form)
    chosen = _with_form(chosen, jobs)
    explained = share_explained(tried.nominal, chosen)
    left = left and left.without(term.name for term in missing)
    return Decision(chosen, missing, explained, left, repairs)


def found_together(tried: JointSearch, jobs: int) -> tuple[MissingTerm, ...]:
    """The effects that several recordings of a rig lack, each with the rivals that all leave."""
    missing: tuple[MissingTerm, ...] = ()
    for level in takewhile(lambda each: each.is_found, tried.levels):
        if not level.adds_nothing(level.best):
            missing = (*missing[: len(level.best.terms) - 1], _missing(level, level.best, jobs))
    return _named_as_chosen(tried, tried.found, missing, jobs)


def _with_form(one: Candidate, jobs: int) -> Candidate:
    return replace(one, fits=(with_form(one.fit, jobs),))


def share_explained(nominal: Candidate, chosen: Candidate) -> float:
    """Share of the misfit above noise that a candidate removes; 1 where there was none."""
    before, after = (float(np.sum(one.fit.residuals**2)) for one in (nominal, chosen))
    above = before - nominal.fit.model.observation.size
    return 1.0 if above <= 0.0 else float(np.clip((before - after) / above, 0.0, 1.0))


def _missing(level: Level, best: Candidate, jobs: int) -> MissingTerm:
    last = best.terms[-1]
    formulas = [c for c in level.at_the_place_of(best) if not c.terms[-1].is_function]
    formula = best if not last.is_function else (formulas[0] if formulas else None)
    name = _name(level, best)
    gain = level.gain(best)
    others = [
        each
        for more, each in level.beside(best.terms[:-1])
        if (_name(level, each) if more is each.terms[-1] else more.id) != name
    ]
    best_other = max((level.gain(each) for each in others), default=0.0)
    if formula is not None and formula is not best:
        formula = _with_form(formula, jobs)
        if may_be_absent(formula.fit, formula.terms[-1].effect):
            # The function is there; the effect whose formula comes nearest may not be.
            name, formula = last.id, None
    tried = _contest(level, best.terms[:-1], (name, best))
    return MissingTerm(last, name, tried, gain, gain - max(best_other, 0.0), level.p_value, formula)


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
    tried: JointSearch, chosen: Candidate, missing: tuple[MissingTerm, ...], jobs: int
) -> tuple[MissingTerm, ...]:
    """The missing terms as chosen: a rival of the first one may have led to a better two."""
    named = []
    adding = [each for each in tried.levels if each.found and not each.adds_nothing(each.best)]
    for position, term in enumerate(chosen.terms):
        if term.multiplies:
            continue
        if position < len(missing) and missing[position].term.id == term.id:
            named.append(missing[position])
            continue
        level = adding[position]
        own = next((c for c in level.found if c.terms and c.terms[-1].id == term.id), None)
        if own is None:
            # One of a pair that replaced what was found first: it was tried beside the other.
            others = (*chosen.terms[:position], *chosen.terms[position + 1 :])
            level = adding[len(chosen.terms) - 1]
            own = replace(chosen, terms=(*others, term))
        named.append(_missing(level, own, jobs))
    # What is missing besides is no other name of it.
    names = {term.name for term in named}
    return tuple(replace(term, contest=term.contest.without(names - {term.name})) for term in named)


def _contest(
    level: Level, terms: tuple[Term, ...], first: tuple[str, Candidate] | None = None
) -> Contest:
    """What was tried at a level beside some terms."""
    # `first` is the name that was chosen, with the candidate that has it; None where none was.
    beside = level.beside(terms)
    tried: dict[str, Candidate] = {}
    formulas = {more.id for more, _ in beside}
    if first is not None and first[1].terms[-1].is_function and first[0] not in formulas:
        # The effect whose function it is, of which no formula was fitted.
        tried[first[0]] = first[1]
    there = [term.id for term in terms]
    for each in level.found:
        if [term.id for term in each.terms] == there and level.adds_nothing(each):
            tried.setdefault(OTHER_NUMBERS, each)
    for more, each in beside:
        if not more.multiplies:
            tried.setdefault(more.id, each)
    entries: list[tuple[list[str], Candidate]] = []
    for name, each in sorted(tried.items(), key=lambda item: -item[1].evidence):
        same = next((names for names, other in entries if are_one(each, other, level.parent)), None)
        if same is None:
            entries.append(([name], each))
        else:
            same.append(name)
    return Contest(
        tuple(tuple(names) for names, _ in entries),
        tuple(level.gain(each) for _, each in entries),
        level.judge.form_is_worth,
        level.is_found and first is not None,
    )


def are_one(one: Candidate, other: Candidate, parent: Candidate) -> bool:
    """Whether two fits with one term more than a parent's differ by less than noise shows."""
    # The difference of two fits to one law is noise along the directions of their own numbers.
    apart = sum(
        float(np.sum((a.residuals - b.residuals) ** 2))
        for a, b in zip(one.fits, other.fits, strict=True)
    )
    own = _numbers(one) + _numbers(other) - 2 * _numbers(parent)
    return apart <= float(chi2.ppf(SAME, max(own, 1)))


def _numbers(one: Candidate) -> int:
    return sum(len(each.theta) for each in one.fits)


@dataclass(frozen=True)
class Rivalry:
    """What was tried in a term's place where it was chosen."""

    # As in `MissingTerm`.
    name: str
    contest: Contest
    margin: float


@dataclass(frozen=True)
class GivenPhysics:
    """A fitted joint without its recording."""

    terms: tuple[Term, ...]  # in the order in which they were added
    base: Array  # (parameters,)
    flags: Mask  # (flags,)
    free: tuple[FreeParameter, ...]  # as in `JointModel`
    theta: Array  # (n,)
    families: tuple[Family, ...] = ()  # as in `JointModel`
    # By id of the term; none where it was not chosen by a search.
    rivalries: Mapping[str, Rivalry] = field(default_factory=dict)


GivenJoints = Mapping[str, GivenPhysics]
"""By joint."""


def without_recording(
    terms: tuple[Term, ...], found: Fit, rivalries: Mapping[str, Rivalry] | None = None
) -> GivenPhysics:
    """The physics of a fit."""
    model = found.model
    return GivenPhysics(
        terms,
        model.base,
        model.flags,
        model.free,
        found.theta,
        model.families,
        dict(rivalries or {}),
    )


def explained_by(
    references: tuple[Fit, Fit], given: GivenPhysics, jobs: int
) -> tuple[JointSearch, Decision]:
    """Fit given physics to a joint, and see what each of its terms is needed for."""
    # Each term gains what the joint loses without it. One term more is searched only where they
    # leave more than another form would. The reference fits are the nominal plant refitted, and as
    # described.
    nominal = candidate((), references[0])
    found = references[0]
    missing: tuple[MissingTerm, ...] = ()
    if given.terms:
        model = JointModel(
            references[0].model.observation,
            given.base,
            given.flags,
            given.free,
            families=given.families,
        )
        found = fit(model, given.theta, iterations=TO_THE_END, tolerance=SETTLED)
        missing = _needed(candidate(given.terms, found), given, jobs)
    beside = decide(JointSearch(candidate((), found), ()), jobs)
    tried: tuple[Level, ...] = ()
    if not beside.adequate:
        tried = search([(found,)], jobs, 1).levels
        beside = decide(JointSearch(candidate((), found), tried), jobs)
    chosen = candidate((*given.terms, *beside.chosen.terms), beside.chosen.fit)
    everything = (*missing, *beside.missing)
    return JointSearch(nominal, tried), Decision(
        chosen, everything, share_explained(nominal, chosen)
    )


def _needed(whole: Candidate, given: GivenPhysics, jobs: int) -> tuple[MissingTerm, ...]:
    """Each given term with what the joint loses without it, and its rivals where it has any."""
    lesser = [without_effect(whole.fit, term.id) for term in whole.terms]
    fits = parallel_map(lambda less: fit(*less), lesser, jobs)
    found = []
    for term, less in zip(whole.terms, fits, strict=True):
        gain = whole.evidence - log_evidence(less)
        alone = Rivalry(term.id, Contest(((term.id,),), (gain,), 0.0, found=True), 0.0)
        rivalry = given.rivalries.get(term.id, alone)
        found.append(
            MissingTerm(
                term,
                rivalry.name,
                rivalry.contest,
                gain,
                rivalry.margin,
                math.nan,
                None if term.is_function else whole,
            )
        )
    return tuple(found)
