"""Engine's and audit's findings in one verdict."""

import math
from collections.abc import Mapping
from dataclasses import replace

from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.audit import AuditReport
from endoscope_explain.decide.conclusions import has_changed, verdict_by_stage
from endoscope_explain.explanation import Explanation, NamedEffect, NominalEstimate, Verdict
from endoscope_explain.fit.free_parameters import nominal_number


def combined_effects(explanation: Explanation, audit: AuditReport) -> tuple[NamedEffect, ...]:
    """Merge the effects that the audit found into the engine's, these after its own.

    An effect that both found is listed once, as the engine fitted it.
    """
    known = {(e.id, e.joint) for e in explanation.effects}
    found = [
        NamedEffect(f.id, f.joint, f.parameters, (), f.evidence)
        for f in audit.faults()
        if f.id in CATALOGUE and (f.id, f.joint) not in known
    ]
    return (*found, *explanation.effects)


def combined_verdict(explanation: Explanation, audit: AuditReport) -> Verdict:
    """Say in one word what engine and audit found.

    Where the rig hardly moves nothing can be told. Missing physics wins over a faulty sensor, that
    over a faulty recording, and any of them over differing parameters: these always differ a
    little. What was mistaken in the recording itself is the verdict: the rest is about another
    recording than was given.
    """
    return Verdict.RECORDING_FAULT if audit.mistakes() else verdict_of_rest(explanation, audit)


def verdict_of_rest(explanation: Explanation, audit: AuditReport) -> Verdict:
    """Say in one word what was found once all mistakes are put right."""
    audit = audit.apart_from_mistakes()
    if explanation.verdict in (Verdict.INSUFFICIENT_DATA, Verdict.UNKNOWN_PHYSICS):
        return explanation.verdict
    if all_refuted(explanation) and not explanation.adequate:
        return Verdict.UNKNOWN_PHYSICS
    effects = combined_effects(explanation, audit)
    if effects or audit.faults():
        return verdict_by_stage(effects)
    return explanation.verdict


def all_refuted(explanation: Explanation) -> bool:
    """Whether effects were named, and a second recording refutes all of them.

    It says nothing of what acted at a time of the first one.
    """
    refuted = [e.doubtful and not e.definition.traits.depends_on_time for e in explanation.effects]
    return bool(refuted) and all(refuted)


def improved_plant(explanation: Explanation, audit: AuditReport) -> PlantDescription:
    """Add what the audit found, and the simulator can do, to the engine's augmented plant."""
    plant = explanation.augmented
    specs = {(e.id, e.joint): e for e in plant.effects}
    for finding in audit.faults():
        definition = CATALOGUE.get(finding.id)
        # Gaps and wrong samples are this recording's alone: the rig will not show them again.
        if definition is not None and not definition.traits.audited:
            names = {parameter.name for parameter in definition.parameters}
            values = {n: e.value for n, e in finding.parameters.items() if n in names}
            spec = EffectSpec(finding.id, finding.joint, values)
            specs.setdefault((finding.id, finding.joint), spec)
    return replace(plant, effects=tuple(specs.values()))


def changed_parameters(estimates: Mapping[str, NominalEstimate]) -> dict[str, NominalEstimate]:
    """Parameters whose intervals exclude their described values, the largest change first."""
    changed = {name: e for name, e in estimates.items() if has_changed(name, e)}

    def reach(item: tuple[str, NominalEstimate]) -> float:
        name, e = item
        if nominal_number(name).spread:
            return abs(e.value - e.nominal)
        return abs(math.log(e.value / e.nominal))

    return dict(sorted(changed.items(), key=lambda item: -reach(item)))
