"""What an investigation asked, why, and what was answered: kept after every step."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path

from endoscope_core.atomic_output import require_place, write_text
from endoscope_core.errors import FileError, InputError
from endoscope_core.investigation_folder import LOG
from endoscope_core.physics.effects import KNOWN
from endoscope_core.physics.hooks import LINKS, TRACKER
from endoscope_core.schema import read

LOG_MD, PLANT = 'log.md', 'plant.yaml'
CALIBRATION, COMMISSIONING = 'calibration', 'commissioning'
SCHEMA = 1


class Stop(StrEnum):
    """Why no further motion is asked for."""

    ONE_CLASS = 'one_class_left'
    NOTHING_TO_GAIN = 'nothing_to_gain'
    USED_UP = 'experiments_used_up'
    INTERRUPTED = 'interrupted'
    FAULT = 'fault'
    FAILED = 'failed'


CUT_SHORT = (Stop.INTERRUPTED, Stop.FAULT, Stop.FAILED)
GOES_ON = (*CUT_SHORT, Stop.USED_UP)
"""After these an investigation may be continued."""
STOP_WORDS = {
    Stop.ONE_CLASS: 'One explanation is left',
    Stop.NOTHING_TO_GAIN: 'Nothing more can be gained',
    Stop.USED_UP: 'The experiments are used up',
    Stop.INTERRUPTED: 'It was interrupted',
    Stop.FAULT: 'The rig stopped it',
    Stop.FAILED: 'It could not go on',
}


@dataclass(frozen=True)
class Name:
    """An effect that the recordings show, as the log keeps it."""

    id: str
    joint: str
    rivals: tuple[str, ...]  # confounded with it, nearest first
    strength: str  # its first number with its 90 % interval, in words
    wide: bool = False  # whether that is known by no more than its order of magnitude
    left_open: str = ''  # the names that hold the truth with 90 %, with their probabilities


@dataclass(frozen=True)
class RigAnswer:
    """What all recordings so far show together."""

    verdict: str
    sentence: str
    names: tuple[Name, ...]
    # Misfit over noise (rms) of the worst signal, by the described and by the improved plant.
    described: float | None
    improved: float | None
    seconds: float  # that explaining took
    places: tuple[str, ...] = ()  # where the described plant fails, and in which regime


@dataclass(frozen=True)
class Round:
    """One motion: what was asked, and what came of it."""

    motion: str  # its waveform
    joint: str  # that it moves
    why: str
    file: str  # of the motion, in the folder
    duration_s: float
    largest_deg: float
    bag: str  # its folder, in the folder
    recorded: bool = False  # whole, from begin to end
    ended: str = ''  # why it is not whole
    answer: RigAnswer | None = None
    # Until the motion was recorded, consent included, and then to find the next one.
    played_s: float = 0.0
    proposed_s: float = 0.0


@dataclass(frozen=True)
class Tracking:
    """How well the tip followed a motion that is among no experiments."""

    by: str  # plant that the compensator inverted
    bag: str  # its folder, in the folder
    rmse_deg: float  # over both joints


@dataclass(frozen=True)
class _Kept:
    """A log as its file has it, but for why it was stopped."""

    schema: int
    plant: str  # file of the described plant
    plant_sha256: str
    rounds: tuple[Round, ...] = ()
    words: str = ''  # why it was stopped, in a sentence
    tracking: tuple[Tracking, ...] = ()  # by the described and by the improved plant
    untracked: str = ''  # why it was not measured


@dataclass(frozen=True)
class Log(_Kept):
    """An investigation from its beginning to now."""

    stopped: Stop | None = None

    @property
    def whole(self) -> tuple[Round, ...]:
        """Rounds that were recorded to their end."""
        return tuple(each for each in self.rounds if each.recorded)

    @property
    def last_answer(self) -> RigAnswer | None:
        """What is known now."""
        answers = [each.answer for each in self.rounds if each.answer is not None]
        return answers[-1] if answers else None

    def known(self) -> dict[str, set[str]]:
        """By joint, all names that were given or left open so far."""
        found: dict[str, set[str]] = {}
        for each in self.rounds:
            for name in each.answer.names if each.answer is not None else ():
                found.setdefault(name.joint, set()).update((name.id, *name.rivals))
        return found

    def with_last(self, **changed: object) -> 'Log':
        """The log with its last round changed."""
        return replace(
            self,
            rounds=(*self.rounds[:-1], replace(self.rounds[-1], **changed)),  # type: ignore[arg-type]
        )

    def with_whole(self, **changed: object) -> 'Log':
        """The log with the last of its rounds that are whole changed."""
        last = self.whole[-1]
        rounds = (replace(r, **changed) if r is last else r for r in self.rounds)  # type: ignore[arg-type]
        return replace(self, rounds=tuple(rounds))

    def write(self, folder: Path) -> None:
        """Write it as data and in sentences."""
        text = json.dumps(asdict(self), indent=1, allow_nan=False)
        write_text(folder / LOG, text + '\n')
        write_text(folder / LOG_MD, '\n'.join(in_sentences(self)) + '\n')


def begun(folder: Path, plant: Path) -> Log:
    """The log of a folder, to be continued, or of a new one; InputError of any other folder."""
    digest = hashlib.sha256(plant.read_bytes()).hexdigest()
    file = folder / LOG
    if not file.exists():
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(
                f'{folder} holds no investigation, and is not empty: name another folder'
            )
        require_place(folder)
        return Log(SCHEMA, str(plant), digest)
    log = _read(file)
    if log.plant_sha256 != digest:
        raise InputError(
            f'{folder} investigates a rig by {log.plant}, which is another plant than {plant} is '
            'now: name another folder'
        )
    if log.stopped is not None and log.stopped not in GOES_ON:
        raise InputError(f'{folder} is at its end: {log.words} Name another folder')
    log = replace(log, stopped=None, words='')
    if log.rounds and not (log.rounds[-1].recorded or log.rounds[-1].ended):
        return log.with_last(ended='the program was killed, or its machine stopped.')
    return log


def _read(file: Path) -> Log:
    try:
        content = json.loads(file.read_text('utf-8'))
    except (OSError, ValueError) as error:
        raise FileError(f'{file} cannot be read as a log: {error}') from error
    stopped = content.pop('stopped', None) if isinstance(content, dict) else None
    if stopped is not None and stopped not in list(Stop):
        raise FileError(f'{file}: stopped is {stopped!r}')
    kept = read(_Kept, content, str(file))
    return Log(**vars(kept), stopped=None if stopped is None else Stop(stopped))


def in_sentences(log: Log) -> list[str]:
    """What was asked, why, and what was answered; Markdown, a line an element."""
    lines = ['# What was asked, and what was answered', '', f'Described plant: `{log.plant}`.']
    for number, each in enumerate(log.rounds, 1):
        lines += ['', f'## {number}. {asked(each)}', '', f'Why: {each.why}', '']
        lines.append(recorded(each))
        if each.answer is not None:
            lines += ['', *(f'- {line}' for line in answered(each.answer))]
    if log.stopped is not None:
        lines += ['', '## End', '', log.words]
    if followed := tracking(log):
        lines += ['', '## Tracking', '', followed]
    lines += ['', '## Times', '', *times(log)] if log.whole else []
    return lines


def tracking(log: Log) -> str:
    """How the tip follows, in a sentence; empty where nobody has tried."""
    if log.untracked:
        return f'Tracking was not measured: {log.untracked.rstrip(".")}.'
    if not log.tracking:
        return ''
    described, improved = (each.rmse_deg for each in log.tracking)
    answer = log.last_answer
    names = {name.id for name in answer.names} if answer else set()
    read = sorted(names & KNOWN.keys() & {effect.id for effect, _ in LINKS[TRACKER.name]})
    text = (
        'On a motion that is among no experiments the tip is off by '
        f'{described:.2g} deg (rms) where the described plant is inverted, '
        f'and by {improved:.2g} deg where the improved one is.'
    )
    if read:
        text += (
            f' Both are as the tracker reads the tip, so that {" and ".join(read)} counts as an '
            'error of it.'
        )
    return text


def times(log: Log) -> list[str]:
    """How long each round took, by its stages."""
    return [
        f'{number}. motion {each.played_s:.0f} s, explaining '
        f'{each.answer.seconds if each.answer else 0.0:.0f} s, next motion {each.proposed_s:.0f} s'
        for number, each in enumerate(log.rounds, 1)
        if each.recorded
    ]


def asked(each: Round) -> str:
    """What a round asks of the rig."""
    return in_words(each.motion, each.joint, each.duration_s, each.largest_deg)


def in_words(motion: str, joint: str, duration_s: float, largest_deg: float) -> str:
    """A motion as a person is asked for it."""
    return f'{motion.capitalize()} of {joint}, {duration_s:.0f} s, at most {largest_deg:.0f} deg'


def recorded(each: Round) -> str:
    """What became of a round's recording."""
    if each.recorded:
        return f'Recorded: `{each.bag}`, as `{each.file}` asks.'
    if each.ended:
        return f'Not recorded to its end: {each.ended}'
    return 'Not recorded yet.'


def answered(answer: RigAnswer) -> Sequence[str]:
    """What is known after a round, in sentences."""
    lines = [answer.sentence]
    for name in answer.names:
        others = ' or '.join(name.rivals)
        clear = f'confounded with {others}' if others else 'no other effect is left open'
        strength = f', {name.strength}' if name.strength else ''
        chances = f'; likely are {name.left_open}' if name.left_open else ''
        lines.append(f'{name.id} of {name.joint}{strength}: {clear}{chances}.')
    lines += [f'Where: {place}.' for place in answer.places]
    if answer.described is not None and answer.improved is not None:
        lines.append(
            f'The worst signal is off by {answer.described:.3g} times its noise with the described '
            f'plant, by {answer.improved:.3g} times with the improved one.'
        )
    lines.append(f'Explained in {answer.seconds:.0f} s.')
    return lines
