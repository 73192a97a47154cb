"""One rig of a proof: recorded to bags, sealed, explained, compared."""

import hashlib
import json
import secrets
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import BagWriter, MessageStream
from endoscope_bags.cdr import encode_joint_states
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bags.recording import rig_record
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import load_plant
from endoscope_core.physics.plant_file import plant_from_mapping, save_plant
from endoscope_explain.case import ExplainedCase, Sources
from endoscope_explain.investigation.motions import Tracked
from endoscope_explain.many_bags import explained_case
from endoscope_explain.observe.predicted_signals import view
from endoscope_explain.recording import (
    BENDING,
    COMMAND,
    MOTOR,
    WIRES,
    RigRecording,
    Series,
    motor_name,
    wire_names,
)
from endoscope_explain.report.sentences import verdict_sentence
from endoscope_explain.report.writing import PLANT_YAML, REPORT_HTML, write_report
from endoscope_lab.concealed.judge import Correctness, Law, judged, statements
from endoscope_lab.proof import SLAVE, slave
from endoscope_lab.proof.drawing import drawn

BEGIN_NS = 1_000_000_000
"""First stamp, one second after the start of simulated time."""


def write_bag(recording: RigRecording, out: Path) -> None:
    """Write commands, motors, wires and tip at their stamps; BagError if `out` cannot be made."""
    motors = [motor_name(joint) for joint in recording.joints]
    wires = [wire for joint in recording.joints for wire in wire_names(joint)]
    sensors = recording.measured()

    def stream(topic: str, names: list[str], **series: Series) -> MessageStream:
        stamps = BEGIN_NS + np.rint(1e9 * next(iter(series.values())).time).astype(np.int64)
        values = {key: s.values.reshape(len(stamps), -1) for key, s in series.items()}
        payloads = encode_joint_states(
            names,
            stamps,
            position=values.get('position'),
            velocity=values.get('velocity'),
            effort=values.get('effort'),
        )
        return MessageStream(f'/{topic}', JOINT_STATE, payloads, stamps, stamps)

    shaft = {
        key: sensors[f'shaft_{key}']
        for key in ('position', 'velocity', 'effort')
        if f'shaft_{key}' in sensors
    }
    with BagWriter(out, records=rig_record(recording.rig)) as writer:
        writer.write_streams(
            [
                stream(COMMAND, motors, position=recording.command),
                stream(MOTOR, motors, **shaft),
                stream(WIRES, wires, effort=sensors['tension']),
                stream(BENDING, list(recording.joints), position=sensors['bending']),
            ]
        )


class BrokenSealError(EndoscopeError, ValueError):
    """A sealed truth was changed."""


def seal(path: Path, truth: dict) -> str:
    """Write a truth as JSON and return the SHA-256 of the file, in hex."""
    # Without a salt, a short truth could be guessed from its digest.
    content = json.dumps(truth | {'salt': secrets.token_hex(16)}, indent=1, default=str)
    path.write_text(content + '\n', encoding='utf-8')
    return digest(path)


def opened(path: Path, published: str) -> dict:
    """Read a truth whose digest was published; BrokenSealError if the file was changed since."""
    if digest(path) != published:
        raise BrokenSealError(f'{path}: its SHA-256 is not the published one: the file was changed')
    truth: dict = json.loads(path.read_text(encoding='utf-8'))
    return truth


def digest(path: Path) -> str:
    """SHA-256 of a file, in hex, as `sha256sum` prints it."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


Array = NDArray[np.float64]

TRUTH, PLANT = 'sealed.json', 'described.yaml'
RECORDING, SECOND = 'recording.mcap', 'second.mcap'
FOLLOWED = 'followed'
REPORT = 'report'
PASSAGE_S = 6.0
"""Length of the second recording that is plotted."""


@dataclass(frozen=True)
class SealedRig:
    """A recorded rig, with its truth sealed."""

    number: int
    folder: Path  # with the recordings, the described plant and the sealed truth
    sha256: str  # of the truth
    laws: tuple[Law, ...]  # injected; not used before the seals are opened
    also: frozenset[str]  # effects and places that are neither right nor false
    moved: float  # change by the laws, over the signal


@dataclass(frozen=True)
class Passage:
    """The signal of the second recording with the largest residual of the refitted plant."""

    signal: str
    unit: str
    time: Array  # (N,), s
    measured: Array  # (N,)
    predicted: dict[str, Array]  # (N,) by the plant as described, refitted and improved


@dataclass(frozen=True)
class SealedAnswer:
    """The explanation of a rig before its seal was opened."""

    number: int
    sentence: str
    reported: tuple
    # Misfit of the second recording over its noise, for the worst signal, with the plant as
    # described, refitted and improved.
    before: float
    refitted: float
    after: float
    passage: Passage
    seconds: float  # time of explaining


@dataclass(frozen=True)
class Outcome:
    """Truth and answer of one rig, compared."""

    rig: SealedRig
    answer: SealedAnswer
    truth: dict  # as it was sealed
    judgement: Correctness
    # Tracking of a motion with the inverse of the plant as described, and as improved; empty for a
    # rig that does not run.
    tracking: dict[str, Tracked] = field(default_factory=dict)


def recorded(form: str, seed: int, number: int, effect: str | None, folder: Path) -> SealedRig:
    """Draw a rig, record it twice, and seal its truth."""
    case, truth = drawn(form, seed, number, effect)
    folder.mkdir()
    sha256 = seal(folder / TRUTH, {'rig': number, 'form': form, 'seed': seed} | truth)
    save_plant(case.described, folder / PLANT)
    if form == SLAVE:
        motions = {RECORDING: slave.EXPLAINED, SECOND: slave.JUDGED}
        for k, (bag, motion) in enumerate(motions.items()):
            slave.record(case.true, motion, folder / bag, seed + k)
    else:
        write_bag(case.recording, folder / RECORDING)
        write_bag(case.second, folder / SECOND)
    return SealedRig(number, folder, sha256, case.laws, case.also, case.moved)


def explained(number: int, folder: Path, command: str) -> SealedAnswer:
    """Explain a rig from its recordings and the described plant, and write the report."""
    plant = load_plant(folder / PLANT)
    bag, second, file = (folder / name for name in (RECORDING, SECOND, PLANT))
    case = explained_case(
        Sources(bag, plant, validate=second, quick=True, jobs=1, plant_file=file, command=command)
    )
    (folder / REPORT).mkdir()
    write_report(case, folder / REPORT)
    explanation = case.explanation
    plants = {'nominal': explanation.nominal, 'refitted': explanation.refitted}
    plants['augmented'] = case.plant
    assert case.inputs.validation is not None
    seen = view(case.inputs.validation, plants)
    worst = max(seen.signals.values(), key=lambda s: np.mean(s.residual('refitted') ** 2))
    named = replace(explanation, verdict=case.verdict, effects=case.effects)
    misfit = partial(_misfit, case)
    return SealedAnswer(
        number,
        verdict_sentence(case),
        statements(named),
        misfit('nominal'),
        misfit('refitted'),
        misfit('augmented'),
        Passage(worst.signal, worst.unit, worst.time, worst.measured, dict(worst.predicted)),
        case.runtime_s,
    )


def compared(rig: SealedRig, answer: SealedAnswer) -> Outcome:
    """Open a rig's seal and judge its explanation; BrokenSealError if the file was changed."""
    truth = opened(rig.folder / TRUTH, rig.sha256)
    return Outcome(rig, answer, truth, judged(rig.laws, answer.reported, rig.also))


def followed(folder: Path, truth: dict, seed: int) -> dict[str, Tracked]:
    """Track a motion with the inverse of a slave's plant as described, and as improved."""
    keys = ('joints', 'sensors', 'effects')
    true = plant_from_mapping({key: truth[key] for key in keys})
    (folder / FOLLOWED).mkdir()
    plants = {'nominal': folder / PLANT, 'augmented': folder / REPORT / PLANT_YAML}
    return {
        name: slave.tracked(true, load_plant(file), folder / FOLLOWED / name, seed + 2)
        for name, file in plants.items()
    }


def worst_stretch(passage: Passage) -> Passage:
    """The stretch of a passage in which the error of the refitted plant is largest."""
    begins = np.arange(0.0, max(passage.time[-1] - PASSAGE_S, 0.0) + 0.25, 0.5)
    missed = np.r_[0.0, np.cumsum((passage.measured - passage.predicted['refitted']) ** 2)]
    ends = np.searchsorted(passage.time, begins + PASSAGE_S)
    begin = begins[np.argmax(missed[ends] - missed[np.searchsorted(passage.time, begins)])]
    inside = (passage.time >= begin) & (passage.time <= begin + PASSAGE_S)
    return replace(
        passage,
        time=passage.time[inside],
        measured=passage.measured[inside],
        predicted={name: values[inside] for name, values in passage.predicted.items()},
    )


def report_of(number: int) -> str:
    """Path of a rig's report, relative to the page."""
    return f'{folder_of(number)}/{REPORT}/{REPORT_HTML}'


def folder_of(number: int) -> str:
    return f'rig_{number}'


def _misfit(case: ExplainedCase, plant: str) -> float:
    return max(fit.ratio for fit in case.validation[plant].values())
