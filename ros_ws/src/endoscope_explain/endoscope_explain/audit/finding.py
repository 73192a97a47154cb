"""What an audit says about a recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

from endoscope_explain.audit.misreading import Misreading
from endoscope_explain.explanation import Estimate
from endoscope_explain.recording import DESIRED, RigRecording, motor_name, signal_name

Column = tuple[str, int]
"""A series of a `RigRecording`, and which of its columns, counted over all joints and wires."""


class Severity(StrEnum):
    """Whether a finding changes the verdict."""

    NOTE = 'note'
    FAULT = 'fault'
    MISTAKE = 'mistake'
    """Somebody took a unit, sign or order wrongly, or a source stood still: it is the verdict."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with the recording itself; times are in s from the first stamp."""

    id: str
    severity: Severity
    joint: str  # joint it concerns; the first one if it concerns all
    stage: str
    signals: tuple[str, ...]  # written `wires/measured_js:wire_x_pos`
    intervals: tuple[tuple[float, float], ...]  # in s from the first stamp
    text: str  # one sentence for a person
    remedy: str  # what was done so that the rest can be explained
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    evidence: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class FindingKind:
    """What findings of one kind have in common; their facts go where `{names}` are."""

    # Of the catalogue if it is one of its effects. Kinds that differ in their words alone share it.
    id: str
    severity: Severity
    text: str
    remedy: str
    stage: str = 'recording'  # or `sensing` or, for exchanged or inverted motors, `actuator`

    def found(
        self,
        recording: RigRecording,
        signals: Sequence[str | Column],
        intervals: Sequence[tuple[float, float]] = (),
        *,
        joint: str = '',
        parameters: Mapping[str, Estimate] | None = None,
        evidence: Mapping[str, float] | None = None,
        **facts: Any,
    ) -> Finding:
        """One over the whole recording and of the first column's joint, where none is given."""
        names = [s if isinstance(s, str) else column_name(recording, s) for s in signals]
        column = ('', 0) if isinstance(signals[0], str) else signals[0]
        spans = tuple(intervals) or ((0.0, recording.duration),)
        (begin, end), evidence = spans[0], evidence or {}
        facts = {'signals': ' and '.join(names), 'begin': begin, 'end': end, **evidence, **facts}
        return Finding(
            self.id,
            self.severity,
            joint or _joint_of(recording, column),
            self.stage,
            tuple(names),
            spans,
            self.text.format_map(facts),
            self.remedy.format_map(facts),
            parameters or {},
            evidence,
        )


def column_name(recording: RigRecording, column: Column) -> str:
    """The name of a column of a measured quantity or of the command."""
    quantity, place = column
    joint = _joint_of(recording, column)
    if quantity == 'command':
        name = joint if recording.command.topic == DESIRED else motor_name(joint)
        return f'{recording.command.topic}:{name}'
    return signal_name(quantity, joint, place % 2 if quantity == 'tension' else 0)


def _joint_of(recording: RigRecording, column: Column) -> str:
    quantity, place = column
    return recording.joints[place // 2 if quantity == 'tension' else place]


@dataclass(frozen=True)
class AuditReport:
    """A recording made fit for analysis, and what had to be done to it."""

    # As corrected, with strictly increasing stamps; samples that must not be judged are not valid.
    recording: RigRecording
    findings: tuple[Finding, ...]  # most serious first
    misreadings: tuple[Misreading, ...] = ()  # that were corrected

    def faults(self) -> tuple[Finding, ...]:
        """Return the findings that change the verdict."""
        return tuple(f for f in self.findings if f.severity is not Severity.NOTE)

    def mistakes(self) -> tuple[Finding, ...]:
        """Return in what the recording was not what its names say."""
        return tuple(f for f in self.findings if f.severity is Severity.MISTAKE)

    def apart_from_mistakes(self) -> 'AuditReport':
        """Return what is wrong beside them."""
        rest = tuple(f for f in self.findings if f.severity is not Severity.MISTAKE)
        return replace(self, findings=rest)
