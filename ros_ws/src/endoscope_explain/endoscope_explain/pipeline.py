"""From bags to an explained case: read, audit, explain, locate, judge, propose."""

import time
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path

from threadpoolctl import threadpool_limits

from endoscope_bags.errors import BagError
from endoscope_core.physics.description import PlantDescription
from endoscope_explain.audit import AuditReport, audit_recording
from endoscope_explain.case import (
    ExplainedCase,
    Inputs,
    Mismatch,
    Sources,
    combined_effects,
    combined_verdict,
    improved_plant,
)
from endoscope_explain.compare import confirmed_by, ladders
from endoscope_explain.design import propose, what_is_asked
from endoscope_explain.explain_recording import Progress, explain_recording
from endoscope_explain.explanation import Explanation, Verdict
from endoscope_explain.fit.nominal import with_command_between_rows, with_isolated_marked
from endoscope_explain.locate.locating import (
    cut_at_motor,
    locate_effects,
    locate_findings,
    locate_parameters,
    locate_unknown,
)
from endoscope_explain.recording import RigRecording, recording_from_bag, with_unrecorded

Engine = Callable[..., Explanation]


def read_inputs(sources: Sources, before: AuditReport | None = None) -> Inputs:
    """Read and audit all recordings of a case; BagError, with its name, if one cannot be used.

    `before` is as for `audit_recording`, for the recording to explain.
    """

    def read(path: Path, plant: PlantDescription) -> RigRecording:
        return recording_from_bag(
            path, plant, without=sources.without, namespace=sources.namespace, rig=sources.rig
        )

    raw = read(sources.bag, sources.plant)
    if before is not None:
        seen = before.recording
        refuse_other_joints(sources.bag, raw.joints, Path(seen.name), seen.joints)
    plant = sources.plant.of_joints(raw.joints)
    mistaken: list[str] = []

    def second(what: str, path: Path | None) -> RigRecording | None:
        if path is None:
            return None
        other = read(path, plant)
        refuse_other_joints(path, other.joints, sources.bag, raw.joints)
        audited = _audited(other, plant)
        mistakes = audited.mistakes()
        mistaken.extend(f'the {what} {other.name}: {f.text}; {f.remedy}' for f in mistakes)
        return audited.recording

    baseline = second('baseline', sources.baseline)
    validation = second('second recording', sources.validate)
    return Inputs(sources, _audited(raw, plant, before), baseline, validation, tuple(mistaken))


def _audited(
    raw: RigRecording, plant: PlantDescription, before: AuditReport | None = None
) -> AuditReport:
    report = audit_recording(raw, plant, before)
    return replace(report, recording=with_command_between_rows(report.recording, plant))


def refuse_other_joints(
    bag: Path, joints: Collection[str], first: Path, joints_of_first: Collection[str]
) -> None:
    """BagError if a bag has not the joints of the first one."""
    if set(joints) != set(joints_of_first):
        raise BagError(
            f'{bag}: has {", ".join(joints)}, but {first} has {", ".join(joints_of_first)}'
        )


def explain_case(
    inputs: Inputs,
    engine: Engine | None = None,
    *,
    progress: Progress | None = None,
    answered: Callable[[ExplainedCase], None] | None = None,
) -> ExplainedCase:
    """Explain a recording by `explain_recording`, or another engine that takes what it takes."""
    # The case is handed to `answered` once it is explained, before a next experiment is looked for.
    begun = time.monotonic()
    report = progress or (lambda _: None)
    sources, audit, validation = inputs.sources, inputs.audit, inputs.validation
    for finding in audit.findings:
        report(f'audit: {finding.text}; {finding.remedy}')
    for other in inputs.mistakes_of_others:
        report(f'audit: {other}')
    # A fit's matrices are tall and narrow: threads would only wait for each other.
    with threadpool_limits(1, 'blas'):
        explanation = (engine or explain_recording)(
            audit.recording,
            inputs.plant,
            baseline=inputs.baseline,
            band=sources.band,
            most_effects=sources.effects,
            given=sources.given,
            known=sources.known,
            jobs=sources.jobs,
            progress=progress,
        )
    plant = improved_plant(explanation, audit)
    if validation is not None:
        validation = with_isolated_marked(validation, plant)
        explanation = replace(explanation, effects=confirmed_by(validation, explanation))
    if explanation.fit:
        report('locating what was found')
    case = ExplainedCase(
        inputs=inputs,
        explanation=explanation,
        verdict=combined_verdict(explanation, audit),
        effects=combined_effects(explanation, audit),
        places=(),
        plant=with_unrecorded(plant, sources.plant),
        ladder={},
    )
    cuts = cut_at_motor(case.recording, explanation.refitted) if explanation.fit else ()
    case = replace(case, places=_places(case), cuts=cuts)
    if answered is not None:
        answered(case)
    if explanation.fit and not sources.quick:
        report('looking for the motion that decides what is left open')
        case = replace(case, next_experiment=propose(case, what_is_asked(case), sources.jobs))
    held_out, second = ladders(explanation, validation)
    return replace(case, ladder=held_out, validation=second, runtime_s=time.monotonic() - begun)


def _places(case: ExplainedCase) -> tuple[Mismatch, ...]:
    if case.verdict in (Verdict.CONSISTENT, Verdict.INSUFFICIENT_DATA):
        return ()
    explanation = case.explanation
    rest = case.audit.apart_from_mistakes()
    audited = {(f.id, f.joint) for f in rest.faults()}
    places = locate_effects(
        case.recording,
        explanation.augmented,
        [e for e in case.effects if (e.id, e.joint) not in audited],
    )
    places += locate_findings(rest.faults())
    if case.rest is Verdict.UNKNOWN_PHYSICS:
        places = locate_unknown(case.recording, explanation) + places
    if case.rest is Verdict.PARAMETERS_DIFFER:
        places += locate_parameters(case.recording, explanation)
    return (*locate_findings(case.audit.mistakes()), *places)
