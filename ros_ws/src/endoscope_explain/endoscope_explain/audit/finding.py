"""What an audit says about a recording."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from endoscope_explain.explanation import Estimate
from endoscope_explain.recording import Recording


class Severity(StrEnum):
    """Whether a finding changes the verdict."""

    NOTE = 'note'
    FAULT = 'fault'
    UNUSABLE = 'unusable'
    """It changes the verdict, and nothing can be learnt from the recording before it is mended."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with the recording itself.

    Attributes
    ----------
    id : str
        Catalogue id (`recording_gap`, `clock_skew`, `tracker_outliers`, `load_cell_saturation`),
        or, for notes, what was found: `repeated_stamps`, `unordered_stamps`, `held_samples`,
        `held_pose`.
    severity : Severity
    joint : str
        Joint it concerns; the first one if it concerns all.
    stage : str
        `recording`, `sensing` or, for exchanged or inverted motors, `actuator`.
    signals : tuple of str
        Written `wires/measured_js:wire_x_pos`.
    intervals : tuple of (float, float)
        In s from the first stamp.
    text : str
        One sentence for a person.
    remedy : str
        What was done so that the rest can be explained.
    parameters : mapping of str to Estimate
    evidence : mapping of str to float
    """

    id: str
    severity: Severity
    joint: str
    stage: str
    signals: tuple[str, ...]
    intervals: tuple[tuple[float, float], ...]
    text: str
    remedy: str
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    evidence: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class AuditReport:
    """A recording made fit for analysis, and what had to be done to it.

    Attributes
    ----------
    recording : Recording
        With strictly increasing stamps; samples that must not be judged are not valid.
    findings : tuple of Finding
        Most serious first.
    """

    recording: Recording
    findings: tuple[Finding, ...]

    def faults(self) -> tuple[Finding, ...]:
        """Return the findings that change the verdict."""
        return tuple(f for f in self.findings if f.severity is not Severity.NOTE)

    @property
    def unusable(self) -> bool:
        """Whether the recording is not what its names say, so that nothing must be fitted to it."""
        return any(f.severity is Severity.UNUSABLE for f in self.findings)
