"""One recording, audited and explained: what every output is made from."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.audit import AuditReport
from endoscope_explain.explanation import ChannelFit, Explanation, NamedEffect, Verdict
from endoscope_explain.fit.free_parameters import BAND
from endoscope_explain.recording import Recording

Ladder = Mapping[str, Mapping[str, ChannelFit]]
"""By rung (`nominal`, `refitted`, `augmented`, black boxes), then by signal."""


@dataclass(frozen=True)
class Place:
    """Where a mismatch shows.

    Attributes
    ----------
    stage, joint : str
    signals : tuple of str
        Largest share of the excess misfit first.
    intervals : tuple of (float, float)
        In s from the first stamp.
    regime : str
        In words, from measured conditions.
    band_hz : (float, float)
        Frequencies that hold most of it.
    shares : mapping of str to float
        Share of the excess misfit of each of the signals.
    onset_s : float or None
        When it began, where it did not act from the start.
    """

    stage: str
    joint: str
    signals: tuple[str, ...]
    intervals: tuple[tuple[float, float], ...]
    regime: str
    band_hz: tuple[float, float]
    shares: Mapping[str, float] = field(default_factory=dict)
    onset_s: float | None = None


@dataclass(frozen=True)
class NextExperiment:
    """The motion that would tell rivals apart.

    `separates`: ids.
    `waveform`: name of the family's member.
    `joint`: the joint that moves.
    `distances`: smallest predicted distance between rivals for each motion tried, in noise units
        rms.
    `time`, `command`: the chosen motion: s, and rad for each joint, as rows.
    `joints`: columns of `command`.
    """

    why: str
    separates: tuple[str, ...]
    waveform: str
    joint: str
    distances: Mapping[str, float]
    time: tuple[float, ...]
    command: tuple[tuple[float, ...], ...]
    joints: tuple[str, ...]


@dataclass(frozen=True)
class Provenance:
    """What a report was made from, so that anybody can make it again.

    `bag`, `plant`: files; the plant's is empty where it came from no file.
    `bag_sha256`, `plant_sha256`: of their bytes; of all messages' files of a bag in the order of
        their names.
    `version`: of the program.
    `command`: as it was typed; empty where no command line made it.
    `date`: ISO 8601.
    """

    bag: str
    bag_sha256: str
    plant: str
    plant_sha256: str
    version: str
    command: str
    date: str


@dataclass(frozen=True)
class ChainCut:
    """Misfit of wires and tip of one joint, in noise units (rms).

    `by_command`: driven by the command, through the simulated servo.
    `by_motor`: driven by the measured shaft.
    """

    joint: str
    by_command: float
    by_motor: float

    @property
    def before_the_motor(self) -> bool:
        """Whether what is wrong lies before the motor's encoder."""
        return self.by_motor < 0.5 * self.by_command


@dataclass(frozen=True)
class ExplainedCase:
    """All that is known about one recording.

    `recording`: as audited.
    `explanation`: the engine's own words.
    `verdict`: of engine and audit together.
    `effects`: of engine and audit together, most certain first.
    `plant`: the improved plant: the engine's augmented one with what the audit found in it.
    `ladder`: on held-out blocks of the recording.
    `validation`: on the second recording; empty if none was given.
    `validation_name`, `baseline_name`: empty if none was given.
    `cuts`: whether the refitted plant does better when the measured motor drives it.
    `band`: relative tolerance of the plant's parameters.
    """

    recording: Recording
    audit: AuditReport
    explanation: Explanation
    verdict: Verdict
    effects: tuple[NamedEffect, ...]
    places: tuple[Place, ...]
    plant: PlantDescription
    ladder: Ladder
    validation: Ladder = field(default_factory=dict)
    validation_name: str = ''
    baseline_name: str = ''
    next_experiment: NextExperiment | None = None
    cuts: tuple[ChainCut, ...] = ()
    band: float = BAND
    provenance: Provenance | None = None
    runtime_s: float = 0.0
