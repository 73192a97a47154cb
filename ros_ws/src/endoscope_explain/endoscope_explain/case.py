"""One recording, audited and explained: what every output is made from."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.audit import AuditReport
from endoscope_explain.decide.combine import verdict_of_rest
from endoscope_explain.explanation import ChannelFit, Explanation, NamedEffect, Verdict
from endoscope_explain.fit.free_parameters import BAND
from endoscope_explain.recording import Recording

Ladder = Mapping[str, Mapping[str, ChannelFit]]
"""By compared model (`nominal`, `refitted`, `augmented`, black boxes), then by signal."""


@dataclass(frozen=True)
class Place:
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


@dataclass(frozen=True)
class NextExperiment:
    """The motion that would tell rivals apart."""

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


@dataclass(frozen=True)
class ExplainedCase:
    """All that is known about one recording."""

    recording: Recording  # as audited
    audit: AuditReport
    explanation: Explanation  # the engine's own words
    verdict: Verdict  # of engine and audit together
    effects: tuple[NamedEffect, ...]  # of engine and audit together, most certain first
    places: tuple[Place, ...]
    # The improved plant: the engine's augmented one with what the audit found in it.
    plant: PlantDescription
    ladder: Ladder  # on held-out blocks of the recording
    # on the second recording; empty if none was given
    validation: Ladder = field(default_factory=dict)
    validation_name: str = ''  # empty if none was given
    baseline_name: str = ''  # empty if none was given
    # What was mistaken in the baseline or the second recording.
    said_of_others: tuple[str, ...] = ()
    next_experiment: NextExperiment | None = None
    # Whether the refitted plant does better when the measured motor drives it.
    cuts: tuple[ChainCut, ...] = ()
    band: float = BAND  # relative tolerance of the plant's parameters
    provenance: Provenance | None = None
    runtime_s: float = 0.0

    @property
    def rest(self) -> Verdict:
        """The verdict with what was mistaken in the recording put right."""
        mistaken = self.audit.mistakes()
        return verdict_of_rest(self.explanation, self.audit) if mistaken else self.verdict
