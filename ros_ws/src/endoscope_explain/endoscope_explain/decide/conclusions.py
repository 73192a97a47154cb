"""What is concluded from the decisions on all joints: names, verdict, plants, ladder of fits."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import norm

from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.physics.effect import Effect, Stage
from endoscope_core.physics.effects import describe
from endoscope_explain.decide.decision import Decision, MissingTerm
from endoscope_explain.explanation import (
    ChannelFit,
    Fitting,
    NamedEffect,
    NominalEstimate,
    Tried,
    UnknownTerm,
    Verdict,
)
from endoscope_explain.fit.evidence import held_out_fit
from endoscope_explain.fit.free_parameters import FITTED_NOMINAL, nominal_number
from endoscope_explain.fit.intervals import effect_estimates, nominal_estimates
from endoscope_explain.fit.model import Fit, joint_of
from endoscope_explain.fit.solver import Ended
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.recording import Array
from endoscope_explain.search.formula import fitted_function, nearest_formula
from endoscope_explain.search.levels import JointSearch
from endoscope_explain.search.refit import Candidate
from endoscope_explain.search.term import Term

CHANGED = 0.04
"""Relative difference of a nominal parameter that is worth a verdict."""
JOINTLY = float(norm.ppf(1.0 - 0.05 / len(FITTED_NOMINAL)) / norm.ppf(0.95))
"""Factor on intervals of all numbers of a joint that hold all of them in 90 % (Bonferroni): of as
many that did not change, each with its own, one would mostly seem to differ."""
MOST = 0.5
"""Share of the misfit that names must explain where they leave more than another form would: with
less, the main thing has no name."""


def named(
    observations: tuple[JointObservation, ...], decisions: list[Decision]
) -> tuple[NamedEffect, ...]:
    """Chosen effects of all joints, what explains most first; each id once before any again."""
    ordered = sorted(
        (
            _named(observation.joint, decision, term)
            for observation, decision in zip(observations, decisions, strict=True)
            for term in decision.missing
            if term.is_known
        ),
        key=lambda e: -e.evidence['gain'],
    )
    # A clock belongs to a device, not to a joint; a tracker's fault shows on both. Each id comes
    # once before any comes again.
    once: dict[tuple[str, str], NamedEffect] = {}
    for effect in ordered:
        shared = effect.stage == Stage.RECORDING
        once.setdefault((effect.id, '' if shared else effect.joint), effect)
    first = {effect.id: effect for effect in reversed(once.values())}
    return tuple(sorted(once.values(), key=lambda e: e is not first[e.id]))


def _named(joint: str, decision: Decision, term: MissingTerm) -> NamedEffect:
    # Of physics that was given, no other name was tried.
    measured = math.isfinite(term.p_value)
    modelled = term.name in decision.chosen.effects
    fitted = decision.chosen if modelled else term.formula
    tried = replace(term.contest, beyond_form=decision.beyond_form)
    return NamedEffect(
        term.name,
        joint,
        {} if fitted is None else effect_estimates(fitted.fit, describe(term.name)),
        tried.alternatives(term.name),
        {
            'gain': term.gain,
            'p_value': term.p_value,
            'margin': term.margin,
            'form': term.contest.form,
            'explained': decision.explained,
            'as_formula': float(modelled),
        },
        tried.probability(term.name) if measured else math.nan,
        tried if measured else None,
    )


def verdict(
    stages: Iterable[str],
    *,
    unknown: bool,
    changed: bool,
    mistaken: bool = False,
    too_little: bool = False,
) -> Verdict:
    """The one word for what was found: by stages of effects and faults, and what else is known."""
    # What was mistaken in the recording itself comes first: the rest is about another recording
    # than was given. Where the rig hardly moves nothing can be known. Missing physics wins over a
    # faulty sensor, that over a faulty recording, and any of them over differing parameters: these
    # always differ a little.
    found = set(stages)
    if mistaken:
        return Verdict.RECORDING_FAULT
    if too_little:
        return Verdict.INSUFFICIENT_DATA
    if unknown:
        return Verdict.UNKNOWN_PHYSICS
    if found & {Stage.ACTUATOR, Stage.TRANSMISSION, Stage.JOINT}:
        return Verdict.MISSING_PHYSICS
    if Stage.SENSING in found:
        return Verdict.SENSOR_FAULT
    if found:
        return Verdict.RECORDING_FAULT
    return Verdict.PARAMETERS_DIFFER if changed else Verdict.CONSISTENT


def is_unknown(decisions: list[Decision]) -> bool:
    """Whether something acts that has no name, or whose names leave the main thing unsaid."""
    unknown = any(not term.is_known for d in decisions for term in d.missing)
    return unknown or any(not d.adequate and d.explained < MOST for d in decisions)


def numbers_differ(decisions: list[Decision]) -> bool:
    """Whether a nominal parameter of any joint differs from its description."""
    return any(
        has_changed(name, e)
        for d in decisions
        for name, e in nominal_estimates(d.chosen.fit, d.chosen.fit.model.base).items()
    )


def has_changed(name: str, estimate: NominalEstimate) -> bool:
    """Whether a nominal parameter differs from its description by more than chance and matter."""
    if not estimate.shown:
        return False
    value, nominal = estimate.value, estimate.nominal
    reach = value - estimate.low if nominal < value else estimate.high - value
    outside = abs(value - nominal) > JOINTLY * reach
    if nominal_number(name).spread:
        return outside and not estimate.in_band
    return outside and abs(np.log(value / nominal)) > CHANGED


def plant_of(plant: PlantDescription, fits: list[Candidate]) -> PlantDescription:
    """A plant with the numbers of its joints' fits, and with their effects and functions."""
    # What is of a device that joints share has the numbers of the joint that shows it best.
    joints, specs, terms = dict(plant.joints), list(plant.effects), list(plant.terms)
    shared: dict[str, tuple[float, Mapping[str, float]]] = {}
    for one in fits:
        joint = one.fit.model.observation.joint
        packed, _ = one.fit.model.packed(one.fit.theta)
        joints[joint] = joint_of(packed)
        for term in one.terms:
            if term.is_function:
                terms.append(unknown_term(one, term).term())
                continue
            spec = spec_of(term.effect, joint, packed)
            specs.append(spec)
            if term.is_nominal:
                # Its numbers stand there.
                first = term.effect.parameters[0]
                absent: dict[str, Any] = {first.name: first.off}
                joints[joint] = replace(joints[joint], **absent)
            if term.effect.traits.of_device:
                known = shared.get(term.id, (np.inf, {}))
                shared[term.id] = min(
                    known, (_width(one.fit, term.effect), spec.parameters), key=lambda each: each[0]
                )
    specs = [replace(s, parameters=shared[s.id][1]) if s.id in shared else s for s in specs]
    return replace(plant, joints=joints, effects=tuple(specs), terms=tuple(terms))


def _width(found: Fit, effect: Effect) -> float:
    """Width of the interval of an effect's first number."""
    estimate = effect_estimates(found, effect)[effect.parameters[0].name]
    return estimate.high - estimate.low


def spec_of(effect: Effect, joint: str, packed: Array) -> EffectSpec:
    """An effect of a joint as a plant has it, with its numbers of `packed` (parameters,)."""
    names = [parameter.name for parameter in effect.parameters]
    values = packed[list(effect.places)].tolist()
    return EffectSpec(effect.id, joint, dict(zip(names, values, strict=True)))


def unknown_term(one: Candidate, term: Term) -> UnknownTerm:
    """A function of a fitted joint, with the formula that comes nearest to it."""
    function = fitted_function(one.fit, term.id)
    formula = nearest_formula(function)
    return UnknownTerm(
        function.joint,
        function.family.place.id,
        function.family.nodes,
        function.values,
        function.deviation,
        formula.expression,
        formula.values,
        formula.share,
        formula.as_good,
        multiplies=term.multiplies,
        lag_s=function.family.lag,
        factors=tuple(
            unknown_term(one, other)
            for other in one.terms
            if other.family is not None
            and other.multiplies
            and not term.multiplies
            and other.family.place.point == function.family.place.point
        ),
    )


def missing_function(decisions: list[Decision]) -> UnknownTerm | None:
    """The function that explains most of what no formula does, of all joints."""
    found = [
        (term.gain, decision, term)
        for decision in decisions
        for term in decision.missing
        if term.term.is_function
    ]
    if not found:
        return None
    _, decision, term = max(found, key=lambda each: each[0])
    siblings = (term.name,) if term.is_known else ()
    tried = replace(term.contest, beyond_form=decision.beyond_form)
    return replace(
        unknown_term(decision.chosen, term.term),
        explained=decision.explained,
        rivals=tried.alternatives(term.term.id),
        siblings=siblings,
        contest=tried,
    )


def refitted(tried: JointSearch, decision: Decision) -> Candidate:
    """The nominal plant of a joint: beyond its band where that is all that was chosen."""
    return tried.nominal if decision.chosen.terms else decision.chosen


def ladder(
    references: list[tuple[Fit, Fit]],
    searches: list[JointSearch],
    decisions: list[Decision],
) -> dict[str, dict[str, ChannelFit]]:
    """Misfit of the plant as described, refitted and augmented, on what was held out."""
    compared: dict[str, dict[str, ChannelFit]] = {'nominal': {}, 'refitted': {}, 'augmented': {}}
    for (_, described), tried, decision in zip(references, searches, decisions, strict=True):
        observation = described.model.observation
        compared['nominal'] |= held_out_fit(observation, described.residuals)
        before = held_out_fit(observation, refitted(tried, decision).unseen[0])
        compared['refitted'] |= before
        compared['augmented'] |= (
            held_out_fit(observation, decision.chosen.unseen[0])
            if decision.chosen.terms
            else before
        )
    return compared


def fitting(found: Fit) -> Fitting:
    """How a fit ended."""
    return Fitting(
        found.ended in (Ended.CONVERGED, Ended.NO_STEP),
        str(found.ended or 'nothing was fitted'),
        found.steps,
        found.at_bounds(),
    )


def candidates(
    observations: tuple[JointObservation, ...], searches: list[JointSearch]
) -> tuple[Tried, ...]:
    """All candidates that were tried, the best first."""
    found = [
        Tried(
            observation.joint,
            tuple(term.id for term in c.terms),
            tried.nominal.evidence - c.evidence,
            float(np.mean(c.fit.residuals**2)),
            not c.terms and c is not tried.nominal,
        )
        for observation, tried in zip(observations, searches, strict=True)
        for c in tried.tried()
    ]
    return tuple(sorted(found, key=lambda c: c.score))
