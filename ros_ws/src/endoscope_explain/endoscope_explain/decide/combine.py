"""Engine's and audit's findings in one verdict."""

import math
from collections.abc import Mapping
from dataclasses import replace

from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.audit import AuditReport, Finding
from endoscope_explain.decide.conclusions import has_changed
from endoscope_explain.explanation import Explanation, NamedEffect, NominalEstimate, Verdict
from endoscope_explain.fit.free_parameters import FORM_SPREAD

PHYSICAL = ('actuator', 'transmission', 'joint')


def combined_effects(explanation: Explanation, audit: AuditReport) -> tuple[NamedEffect, ...]:
    """Merge the effects that the audit found into those of the engine.

    Parameters
    ----------
    explanation : Explanation
    audit : AuditReport

    Returns
    -------
    tuple of NamedEffect
        Most certain first; an effect that both found is listed once, as the engine fitted it.
    """
    effects = list(explanation.effects)
    known = {(e.id, e.joint) for e in effects}
    for finding in audit.faults():
        if finding.id in CATALOGUE and (finding.id, finding.joint) not in known:
            effects.append(_effect_of(finding))
    return tuple(sorted(effects, key=lambda e: -e.probability))


def combined_verdict(explanation: Explanation, audit: AuditReport) -> Verdict:
    """Say in one word what engine and audit found.

    Where the rig hardly moves nothing can be told. Missing physics wins over a faulty sensor, that
    over a faulty recording, and any of them over differing parameters: these always differ a
    little.
    """
    if explanation.verdict is Verdict.INSUFFICIENT_DATA:
        return Verdict.INSUFFICIENT_DATA
    effects = combined_effects(explanation, audit)
    stages = {effect.stage for effect in effects}
    if explanation.verdict is Verdict.UNKNOWN_PHYSICS:
        return Verdict.UNKNOWN_PHYSICS
    if stages & set(PHYSICAL):
        return Verdict.MISSING_PHYSICS
    if 'sensing' in stages:
        return Verdict.SENSOR_FAULT
    if 'recording' in stages or audit.faults():
        return Verdict.RECORDING_FAULT
    return explanation.verdict


def improved_plant(explanation: Explanation, audit: AuditReport) -> PlantDescription:
    """Add what the audit found, and the simulator can do, to the engine's augmented plant."""
    plant = explanation.augmented
    present = {(e.id, e.joint) for e in plant.effects}
    added = []
    for finding in audit.faults():
        definition = CATALOGUE.get(finding.id)
        # Gaps and wrong samples are this recording's alone: the rig will not show them again.
        if definition is None or definition.traits.audited:
            continue
        if (finding.id, finding.joint) in present:
            continue
        names = {parameter.name for parameter in definition.parameters}
        values = {n: e.value for n, e in finding.parameters.items() if n in names}
        added.append(EffectSpec(finding.id, finding.joint, values))
        present.add((finding.id, finding.joint))
    return replace(plant, effects=plant.effects + tuple(added))


def changed_parameters(estimates: Mapping[str, NominalEstimate]) -> dict[str, NominalEstimate]:
    """Return the parameters whose intervals exclude their described values, largest change first.

    Parameters
    ----------
    estimates : mapping of str to NominalEstimate

    Returns
    -------
    dict of str to NominalEstimate
    """
    changed = {name: e for name, e in estimates.items() if has_changed(name, e)}

    def reach(item: tuple[str, NominalEstimate]) -> float:
        name, e = item
        if name in FORM_SPREAD:
            return abs(e.value - e.nominal)
        return abs(math.log(e.value / e.nominal))

    return dict(sorted(changed.items(), key=lambda item: -reach(item)))


def _effect_of(finding: Finding) -> NamedEffect:
    definition = CATALOGUE[finding.id]
    return NamedEffect(
        finding.id,
        finding.joint,
        finding.stage,
        finding.probability,
        definition.equation,
        definition.source,
        finding.parameters,
        (),
        finding.evidence,
    )
