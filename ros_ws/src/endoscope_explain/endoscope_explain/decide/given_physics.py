"""Explain a joint by physics that was chosen elsewhere."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from endoscope_core.workers import parallel_map
from endoscope_explain.decide.decision import Decision, MissingTerm, decide, share_explained
from endoscope_explain.fit.evidence import log_evidence
from endoscope_explain.fit.family import Family
from endoscope_explain.fit.free_parameters import FreeParameter
from endoscope_explain.fit.model import (
    TO_THE_END,
    Fit,
    JointModel,
    fit,
    without_effect,
)
from endoscope_explain.prediction_set import Contest
from endoscope_explain.recording import Array, Mask
from endoscope_explain.search.levels import JointSearch, Level, search
from endoscope_explain.search.refit import SETTLED, Candidate, candidate
from endoscope_explain.search.term import Term


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
