"""What is wrong with a recording itself, before anything is explained from it."""

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.audit.examined import Examined
from endoscope_explain.audit.finding import AuditReport, Finding, Severity
from endoscope_explain.audit.findings import (
    clock_rate,
    earlier_motion,
    frozen,
    held_pose,
    held_samples,
    load_cells,
    misread,
    missing_samples,
    motor_at_rest,
    stamp_jitter,
    stamp_order,
    stamp_unit,
    stray_poses,
)
from endoscope_explain.audit.plausibility import as_meant
from endoscope_explain.recording import RigRecording

__all__ = ['AuditReport', 'Finding', 'Severity', 'audit_recording']

STEPS = (
    stamp_order,
    stamp_unit,
    stamp_jitter,
    clock_rate,
    missing_samples,
    frozen,
    misread,
    motor_at_rest,
    held_pose,
    load_cells,
    held_samples,
    stray_poses,
    earlier_motion,
)
"""Each finds what is wrong and puts it right; it needs what those before it have put right."""


def audit_recording(
    recording: RigRecording, plant: PlantDescription, before: AuditReport | None = None
) -> AuditReport:
    """Find what is wrong with a recording, and correct it to what it must mean where it can be.

    `before` is the audit of the recording of the same set-up before it: units, signs and orders are
    the same, and it begins where that one ended unless its readings say that the rig was moved.
    """
    own = plant.of_joints(recording.joints)
    known = () if before is None else before.misreadings
    there = {'command', *recording.measured()}
    meant = as_meant(recording, [each for each in known if each.quantity in there])
    seen = Examined(meant, meant, own, misreadings=known, before=before)
    for step in STEPS:
        seen = step.find(seen)
    order = (Severity.MISTAKE, Severity.FAULT, Severity.NOTE)
    findings = sorted(seen.findings, key=lambda f: order.index(f.severity))
    return AuditReport(seen.recording, tuple(findings), seen.misreadings)
