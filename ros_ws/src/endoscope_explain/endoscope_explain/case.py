"""One recording, audited and explained: what every output is made from."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.physics.effect import Stage
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.audit import AuditReport
from endoscope_explain.decide.conclusions import has_changed, verdict
from endoscope_explain.decide.decision import GivenJoints
from endoscope_explain.explanation import (
    ChannelFit,
    Explanation,
    NamedEffect,
    NominalEstimate,
    Verdict,
)
from endoscope_explain.fit.free_parameters import nominal_number
from endoscope_explain.options import Options
from endoscope_explain.recording import RigRecording
from endoscope_explain.search.term import Known


@dataclass(frozen=True)
class Sources(Options):
    """What one explanation is made from."""

    bag: Path  # the recording to explain
    plant: PlantDescription  # the simulation that an engineer has
    given: GivenJoints | None = None  # the physics of each joint, if it is not to be searched
    # By joint, what other recordings of the rig gave or left open.
    known: Mapping[str, Known] = field(default_factory=dict)
    plant_file: Path | None = None  # where the plant was read from
    command: str = ''  # as it was typed


@dataclass(frozen=True)
class Inputs:
    """The sources, read and audited."""

    sources: Sources
    audit: AuditReport
    # As audited.
    baseline: RigRecording | None = None
    validation: RigRecording | None = None
    mistakes_of_others: tuple[str, ...] = ()  # what somebody took wrongly in these two, in words

    @property
    def plant(self) -> PlantDescription:
        """Return the plant as described, with the recorded joints only."""
        return self.sources.plant.of_joints(self.audit.recording.joints)


def combined_effects(explanation: Explanation, audit: AuditReport) -> tuple[NamedEffect, ...]:
    """Merge the effects that the audit found into the engine's, these after its own."""
    # An effect that both found is listed once, as the engine fitted it.
    known = {(e.id, e.joint) for e in explanation.effects}
    found = [
        NamedEffect(f.id, f.joint, f.parameters, (), f.evidence)
        for f in audit.faults()
        if f.id in CATALOGUE and (f.id, f.joint) not in known
    ]
    return (*found, *explanation.effects)


def combined_verdict(explanation: Explanation, audit: AuditReport) -> Verdict:
    """The verdict of the engine, given the audit and what a second recording refutes."""
    of_engine = explanation.verdict
    refuted = all_refuted(explanation) and not explanation.adequate
    return verdict(
        # Faults that are no effect of the catalogue are the recording's.
        [effect.stage for effect in combined_effects(explanation, audit)]
        + [Stage.RECORDING for _ in audit.faults()],
        unknown=refuted or of_engine is Verdict.UNKNOWN_PHYSICS,
        changed=of_engine is Verdict.PARAMETERS_DIFFER,
        mistaken=bool(audit.mistakes()),
        too_little=of_engine is Verdict.INSUFFICIENT_DATA,
    )


def all_refuted(explanation: Explanation) -> bool:
    """Whether effects were named, and a second recording refutes all of them."""
    # It shows nothing of what acted at a time of the first one.
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
    """Parameters that differ, the largest change first, and those at a bound after the others."""
    changed = {name: e for name, e in estimates.items() if has_changed(name, e)}

    def order(item: tuple[str, NominalEstimate]) -> tuple[bool, float]:
        name, e = item
        if nominal_number(name).spread:
            return e.at_bound, -abs(e.value - e.nominal)
        return e.at_bound, -abs(math.log(e.value / e.nominal))

    return dict(sorted(changed.items(), key=order))


Ladder = Mapping[str, Mapping[str, ChannelFit]]
"""By compared model (`nominal`, `refitted`, `augmented`), then by signal."""


@dataclass(frozen=True)
class Mismatch:
    """Where a mismatch shows."""

    stage: str
    joint: str
    signals: tuple[str, ...]  # largest share of the excess misfit first
    intervals: tuple[tuple[float, float], ...]  # in s from the first stamp
    regime: str  # in words, from measured conditions
    band_hz: tuple[float, float]  # frequencies that hold most of it
    # Share of the excess misfit of each of the signals.
    shares: Mapping[str, float] = field(default_factory=dict)
    onset_s: float | None = None  # when it began, where it did not act from the start


EXPERIMENT_FILE = 'next_experiment.csv'
"""Name of the motion's file beside report.json."""


@dataclass(frozen=True)
class NextExperiment:
    """The motion that would decide between alternatives."""

    why: str
    separates: tuple[str, ...]  # ids
    waveform: str  # name of the family's member
    joint: str  # that moves
    # Smallest predicted distance between rivals for each motion tried, in noise units rms.
    distances: Mapping[str, float]
    time: tuple[float, ...]  # s
    command: tuple[tuple[float, ...], ...]  # rad for each joint, as rows
    joints: tuple[str, ...]  # columns of `command`


@dataclass(frozen=True)
class Provenance:
    """What a report was made from, so that anybody can make it again."""

    bag: str  # file
    # Of its bytes; of all messages' files of a bag in the order of their names.
    bag_sha256: str
    plant: str  # file; empty where it came from none
    plant_sha256: str
    version: str  # of the program
    command: str  # as it was typed; empty where no command line made it
    date: str  # ISO 8601


@dataclass(frozen=True)
class ChainCut:
    """Misfit of wires and tip of one joint, in noise units (rms)."""

    joint: str
    by_command: float  # driven by the command, through the simulated servo
    by_motor: float  # driven by the measured shaft

    @property
    def before_the_motor(self) -> bool:
        """Whether what is wrong lies before the motor's encoder."""
        return self.by_motor < 0.5 * self.by_command


@dataclass(frozen=True, kw_only=True)
class ExplainedCase:
    """All that is known about one recording."""

    inputs: Inputs
    explanation: Explanation  # the engine's own words
    verdict: Verdict  # of engine and audit together
    effects: tuple[NamedEffect, ...]  # of engine and audit together, most certain first
    places: tuple[Mismatch, ...]
    # The improved plant: the engine's augmented one with what the audit found in it.
    plant: PlantDescription
    ladder: Ladder  # on what was held out of the recording
    # on the second recording; empty if none was given
    validation: Ladder = field(default_factory=dict)
    next_experiment: NextExperiment | None = None
    # Whether the refitted plant does better when the measured motor drives it.
    cuts: tuple[ChainCut, ...] = ()
    provenance: Provenance | None = None
    runtime_s: float = 0.0

    @property
    def audit(self) -> AuditReport:
        """What the audit found in the recording."""
        return self.inputs.audit

    @property
    def recording(self) -> RigRecording:
        """The recording, as audited."""
        return self.audit.recording

    @property
    def validation_name(self) -> str:
        """Name of the second recording; empty if none was given."""
        return '' if self.inputs.validation is None else self.inputs.validation.name

    @property
    def rest(self) -> Verdict:
        """The verdict with what was mistaken in the recording put right."""
        if not self.audit.mistakes():
            return self.verdict
        return combined_verdict(self.explanation, self.audit.apart_from_mistakes())
