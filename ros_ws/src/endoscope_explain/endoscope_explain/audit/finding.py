"""What an audit says about a recording."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from endoscope_explain.explanation import Estimate
from endoscope_explain.recording import Recording


class Severity(StrEnum):
    """Whether a finding changes the verdict."""

    NOTE = 'note'
    FAULT = 'fault'
    MISTAKE = 'mistake'
    """Somebody took a unit, sign or order wrongly, or a source stood still: it is the verdict."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with the recording itself; times are in s from the first stamp."""

    # Catalogue id (`recording_gap`, `clock_skew`, `tracker_outliers`, `load_cell_saturation`), or
    # what was found: `wrong_unit`, `wrong_sign`, `exchanged`, `wrong_gear`, `frozen`,
    # `repeated_stamps`, `unordered_stamps`, `jittering_stamps`, `held_samples`,
    # `held_pose`.
    id: str
    severity: Severity
    joint: str  # joint it concerns; the first one if it concerns all
    stage: str  # `recording`, `sensing` or, for exchanged or inverted motors, `actuator`
    signals: tuple[str, ...]  # written `wires/measured_js:wire_x_pos`
    intervals: tuple[tuple[float, float], ...]  # in s from the first stamp
    text: str  # one sentence for a person
    remedy: str  # what was done so that the rest can be explained
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    evidence: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class AuditReport:
    """A recording made fit for analysis, and what had to be done to it."""

    # As corrected, with strictly increasing stamps; samples that must not be judged are not valid.
    recording: Recording
    findings: tuple[Finding, ...]  # most serious first

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
