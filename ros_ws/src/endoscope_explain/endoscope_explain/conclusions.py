"""What is concluded from the decisions on all joints: names, verdict, plants, ladder of fits."""

from dataclasses import replace

import numpy as np

from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.physics.effect import Stage
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.beyond_band import leaves_band_of
from endoscope_explain.compose import Composition
from endoscope_explain.decision import Decision
from endoscope_explain.explanation import (
    Candidate,
    ChannelFit,
    NamedEffect,
    NominalEstimate,
    UnknownTerm,
    Verdict,
)
from endoscope_explain.fit.free_parameters import FORM_SPREAD, FRICTION_PROFILE_NAMES
from endoscope_explain.fit.intervals import effect_estimates, nominal_estimates
from endoscope_explain.fit.model import Fit
from endoscope_explain.fit.score import misfit
from endoscope_explain.fit.simulated_joint import joint_of
from endoscope_explain.held_out import held_out_fit, held_out_masks, on_samples
from endoscope_explain.observation import JointObservation
from endoscope_explain.probability import probability
from endoscope_explain.search import JointSearch

CHANGED = 0.04
"""Relative difference of a nominal parameter that is worth a verdict."""
NOMINAL_UNITS = {
    'pretension': 'N',
    'wire_stiffness': 'N/m',
    'joint_radius': 'm',
    'pulley_radius': 'm',
    'capstan_exponent': '-',
    'joint_stiffness': 'N m/rad',
    'joint_damping': 'N m s/rad',
    'joint_friction': 'N m',
    'joint_presliding': 'rad',
    'joint_presliding_spread': '-',
    'pretension_profile': '-',
    'joint_rest_angle': 'rad',
    **dict.fromkeys(FRICTION_PROFILE_NAMES, '-'),
    'motor_bandwidth': 'rad/s',
    'motor_damping_ratio': '-',
}


def named(
    observations: tuple[JointObservation, ...], decisions: list[Decision]
) -> tuple[NamedEffect, ...]:
    """Chosen effects of all joints, the most certain first and each id once before any again."""
    effects = []
    for observation, decision in zip(observations, decisions, strict=True):
        for effect_id in decision.chosen.effects:
            definition = CATALOGUE[effect_id]
            rivals = decision.alternatives[effect_id]
            effects.append(
                NamedEffect(
                    effect_id,
                    observation.joint,
                    str(definition.stage),
                    probability(
                        decision.gaps[effect_id],
                        decision.margins[effect_id],
                        decision.adequate,
                        len(rivals),
                    ),
                    definition.equation,
                    definition.source,
                    effect_estimates(
                        decision.chosen.fit,
                        definition.first_parameter,
                        {p.name: p.unit for p in definition.parameters},
                    ),
                    rivals,
                    {
                        'margin': decision.margins[effect_id],
                        'gap': decision.gaps[effect_id],
                        'explained': decision.explained,
                    },
                )
            )
    ordered = sorted(effects, key=lambda e: (-e.probability, -e.evidence['margin']))
    # A clock belongs to a device, not to a joint; a tracker's fault shows on both. Each id comes
    # once before any comes again.
    once: dict[tuple[str, str], NamedEffect] = {}
    for effect in ordered:
        shared = CATALOGUE[effect.id].stage == Stage.RECORDING
        once.setdefault((effect.id, '' if shared else effect.joint), effect)
    seen: set[str] = set()
    first: list[NamedEffect] = []
    again: list[NamedEffect] = []
    for effect in once.values():
        (again if effect.id in seen else first).append(effect)
        seen.add(effect.id)
    return tuple(first + again)


def verdict_of(effects: tuple[NamedEffect, ...], decisions: list[Decision]) -> Verdict:
    """What the named effects, or the parameters alone, amount to."""
    if not all(d.adequate for d in decisions):
        return Verdict.UNKNOWN_PHYSICS
    stages = {effect.stage for effect in effects}
    if stages & {Stage.ACTUATOR, Stage.TRANSMISSION, Stage.JOINT}:
        return Verdict.MISSING_PHYSICS
    if Stage.SENSING in stages:
        return Verdict.SENSOR_FAULT
    if Stage.RECORDING in stages:
        return Verdict.RECORDING_FAULT
    changed = any(
        has_changed(name, e)
        for d in decisions
        for name, e in nominal_estimates(
            d.chosen.fit, d.chosen.fit.model.base, NOMINAL_UNITS
        ).items()
    )
    return Verdict.PARAMETERS_DIFFER if changed else Verdict.CONSISTENT


def has_changed(name: str, estimate: NominalEstimate) -> bool:
    """Whether a nominal parameter differs from its description by more than chance and matter."""
    outside = estimate.low > estimate.nominal or estimate.high < estimate.nominal
    if name in FORM_SPREAD:
        return outside and not estimate.in_band
    return outside and abs(np.log(estimate.value / estimate.nominal)) > CHANGED


def plant_of(
    plant: PlantDescription, fits: list[Fit], effects: list[tuple[str, ...]]
) -> PlantDescription:
    """A plant with the parameters of its joints' fits, and with their effects."""
    joints, specs = dict(plant.joints), list(plant.effects)
    for f, added in zip(fits, effects, strict=True):
        joint = f.model.observation.joint
        packed, _ = f.model.packed(f.theta)
        joints[joint] = joint_of(packed)
        for effect_id in added:
            definition = CATALOGUE[effect_id]
            first = definition.first_parameter
            specs.append(
                EffectSpec(
                    effect_id,
                    joint,
                    {p.name: float(packed[first + i]) for i, p in enumerate(definition.parameters)},
                )
            )
    return replace(plant, joints=joints, effects=tuple(specs))


def with_term(plant: PlantDescription, unknown: UnknownTerm | None) -> PlantDescription:
    """The plant with a function that no effect of the catalogue is."""
    if unknown is None:
        return plant
    return replace(plant, terms=(*plant.terms, unknown.term()))


def refitted(tried: JointSearch, decision: Decision) -> Composition:
    """The nominal plant of a joint: beyond its band where that is all that was chosen."""
    return tried.nominal if decision.chosen.effects else decision.chosen


def ladder(
    anchors: list[tuple[Fit, Fit]],
    searches: list[JointSearch],
    decisions: list[Decision],
    final: list[Fit],
) -> dict[str, dict[str, ChannelFit]]:
    """Misfit of the plant as described, refitted and augmented, on held-out blocks."""
    rungs: dict[str, dict[str, ChannelFit]] = {'nominal': {}, 'refitted': {}, 'augmented': {}}
    for (_, described), tried, decision, last in zip(
        anchors, searches, decisions, final, strict=True
    ):
        observation = described.model.observation
        judged, _ = held_out_masks(observation)
        rungs['nominal'] |= on_samples(observation, described.residuals, judged)
        before = refitted(tried, decision).fit
        rungs['refitted'] |= held_out_fit(before)
        rungs['augmented'] |= (
            held_out_fit(last)
            if last is not before
            else {s.signal: rungs['refitted'][s.signal] for s in observation.channels}
        )
    return rungs


def candidates(
    observations: tuple[JointObservation, ...], searches: list[JointSearch]
) -> tuple[Candidate, ...]:
    """All compositions that were tried, the best first."""
    found = []
    for observation, tried in zip(observations, searches, strict=True):
        for c in tried.tried():
            found.append(
                Candidate(
                    observation.joint,
                    c.effects,
                    c.score,
                    misfit(c.fit).total / observation.size,
                    leaves_band_of(c.fit, tried.nominal.fit),
                )
            )
    return tuple(sorted(found, key=lambda c: c.score))
