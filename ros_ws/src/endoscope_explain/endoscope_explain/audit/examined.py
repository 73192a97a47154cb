"""A recording on its way through the steps of an audit."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.audit.finding import Finding
from endoscope_explain.audit.plausibility import Comparison
from endoscope_explain.recording import Array, Mask, RigRecording


@dataclass(frozen=True)
class Examined:
    """What a step of the audit takes and gives: each finds something and puts it right."""

    recorded: RigRecording  # as it came
    recording: RigRecording  # as put right so far
    plant: PlantDescription  # of the recorded joints
    findings: tuple[Finding, ...] = ()
    comparison: Comparison | None = None  # with the plant, of what is long enough

    @property
    def noisy(self) -> bool:
        """Whether the readings have noise, as those of a simulation have not."""
        return self.comparison is None or self.comparison.is_noisy()

    def found(self, *findings: Finding, **changed: Any) -> 'Examined':
        """The same with findings added, and what was changed for them."""
        return replace(self, findings=(*self.findings, *findings), **changed)


def without_times(recording: RigRecording, wrong: Callable[[Array], Mask]) -> RigRecording:
    """The recording with no sample valid at wrong times, of (N,) in s, of all or each joint."""
    return recording.with_series(
        {
            name: s.without(wrong(s.time).reshape(len(s.time), -1, *(1,) * (s.values.ndim - 2)))
            for name, s in recording.measured().items()
        }
    )
