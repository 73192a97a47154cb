"""Investigations of the rig: each a command that requests motions, with the operator's consent."""

import asyncio
import json
import secrets
import time
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from endoscope_console.access import REPORTS
from endoscope_console.background import BackgroundCommand
from endoscope_console.explanations import PLANT_FILE, REPORT_FILE, Explanations
from endoscope_core.errors import EndoscopeError, NotPlayedError, RigStoppedError
from endoscope_core.investigation_folder import LOG, PAGE

_ENDED = ('one_class_left', 'nothing_to_gain')
"""After these there is nothing to continue."""
_LISTED = 5
_SENTENCES = 40
_UNEXPECTED = 'the server of the page failed in it; its terminal says how'


@dataclass(frozen=True)
class AskedMotion:
    """A motion that an investigation asks for."""

    words: str  # as a person is asked for it
    why: str
    duration: float  # in s
    file: Path
    bag: Path  # that it is recorded to
    plant: Path | None  # that the compensator inverts meanwhile; None for no compensation

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> 'AskedMotion':
        """Read it as the command writes it."""
        return cls(
            document['words'],
            document['why'],
            document['duration'],
            Path(document['file']),
            Path(document['bag']),
            Path(document['plant']) if document['plant'] else None,
        )


Consent = Callable[[str], Awaitable[bool]]
"""Asks the operator, in words, whether something may be done."""
Play = Callable[[AskedMotion, Consent], Awaitable[None]]


@dataclass
class Question:
    """What an operator is asked."""

    id: str
    words: str
    why: str
    answer: asyncio.Future[bool]


@dataclass
class ShownInvestigation:
    """One investigation, under way or ended."""

    id: str  # by which a page refers to it
    folder: Path
    secret: str  # part of its page's address that nobody can guess
    running: bool = False
    plays: bool = False  # a motion is asked for, or being played
    step: str = ''  # what is being computed
    sentences: list[str] = field(default_factory=list)  # of its log, as they were written
    question: Question | None = None
    sentence: str = ''  # how it ended
    error: str = ''  # why it failed
    goes_on: bool = False  # it may be continued
    report: str | None = None  # path of its page's address; None where there is none
    improved: str = ''  # name of the improved plant; empty where there is none

    def look(self) -> None:
        """Take from its folder how it has ended."""
        self.running, self.step, self.question = False, '', None
        try:
            log = json.loads((self.folder / LOG).read_text('utf-8'))
            stopped, self.sentence = log['stopped'], log['words']
        except (OSError, ValueError, KeyError, TypeError) as error:
            self.error = self.error or f'{self.folder / LOG} is not the log of one: {error}'
            return
        self.goes_on = stopped not in _ENDED
        if (self.folder / PAGE).is_file():
            self.report = f'{REPORTS}{self.secret}/{REPORT_FILE}'
        if (self.folder / PLANT_FILE).is_file():
            self.improved = f'{self.folder.name}/{PLANT_FILE}'

    def as_mapping(self) -> dict[str, Any]:
        """Its part of the state that pages receive."""
        asked = self.question
        keys = ('id', 'running', 'plays', 'step', 'sentence', 'goes_on', 'report', 'improved')
        return {key: getattr(self, key) for key in keys} | {
            'name': self.folder.name,
            'sentences': self.sentences[-_SENTENCES:],
            'question': asked and {'id': asked.id, 'words': asked.words, 'why': asked.why},
            'error': self.error or None,
        }


class Investigations:
    """Those of one folder, of which one at a time is under way."""

    def __init__(
        self, folder: Path, explanations: Explanations, background: BackgroundCommand
    ) -> None:
        self._folder, self._explanations, self._background = folder, explanations, background
        self._all: dict[str, ShownInvestigation] = {}
        self._asking: asyncio.Task[None] | None = None
        self._questions = 0
        # Those that are there can be read again, and continued.
        for file in sorted(folder.glob(f'*/{LOG}'), key=lambda file: file.stat().st_mtime):
            self._new(file.parent).look()

    def as_list(self) -> list[dict[str, Any]]:
        """The last ones in the state that pages receive, newest first."""
        return [one.as_mapping() for one in list(self._all.values())[: -_LISTED - 1 : -1]]

    def file_of(self, secret: str) -> Path | None:
        """The page whose address has this part; None for none."""
        for one in self._all.values():
            if secrets.compare_digest(one.secret, secret) and (one.folder / PAGE).is_file():
                return one.folder / PAGE
        return None

    def _new(self, folder: Path) -> ShownInvestigation:
        one = ShownInvestigation(f'i{len(self._all) + 1}', folder, secrets.token_urlsafe(16))
        self._all[one.id] = one
        return one

    def begin(self, plant: str | None, own: str, rig: str, experiments: int, play: Play) -> str:
        """Begin one by a plant, the graph's own where none is named; its id."""
        self._background.require_free()
        file = self._explanations.plant_file(plant, own)
        one = self._new(self._folder / f'investigation-{time.strftime("%Y%m%d-%H%M%S")}')
        return self._start(one, file, rig, experiments, play)

    def resume(self, name: str, rig: str, experiments: int, play: Play) -> str:
        """Continue one that was interrupted; its id."""
        self._background.require_free()
        one = self._all.get(name)
        if one is None or not one.goes_on:
            raise EndoscopeError(f'there is no investigation {name} that may be continued')
        plant = json.loads((one.folder / LOG).read_text('utf-8'))['plant']
        one.sentence = one.error = ''
        return self._start(one, Path(plant), rig, experiments, play)

    def _start(
        self, one: ShownInvestigation, plant: Path, rig: str, experiments: int, play: Play
    ) -> str:
        one.running, one.goes_on, one.sentences = True, False, []
        words = ['investigate', '--lines', '--plant', str(plant), '--out', str(one.folder)]
        words += ['--experiments', str(experiments), '--jobs', '1']
        words += ['--rig', rig] if rig else []
        self._background.start('the rig is being investigated', self._follow(one, words, play))
        return one.id

    async def _follow(self, one: ShownInvestigation, words: list[str], play: Play) -> None:
        def take(line: str) -> None:
            message = json.loads(line)
            if 'say' in message:
                one.sentences.append(message['say'])
            else:
                one.plays = True
                motion = AskedMotion.of(message['play'])
                self._asking = asyncio.get_running_loop().create_task(self._ask(one, motion, play))

        def take_step(line: str) -> None:
            one.step = line.strip() or one.step

        try:
            status = await self._background.run(words, take, take_step, answers=True)
        except (OSError, ValueError, KeyError, TypeError) as error:
            one.error = f'it could not be followed: {error}'
        else:
            one.error = one.step if status == 2 else ''
        # It may have been killed while it asked for a motion.
        await self.close()
        one.look()

    async def _ask(self, one: ShownInvestigation, motion: AskedMotion, play: Play) -> None:
        """Have a motion played, and write its outcome to the command."""

        async def consent(words: str) -> bool:
            self._questions += 1
            answer: asyncio.Future[bool] = asyncio.get_running_loop().create_future()
            one.question = Question(f'q{self._questions}', words, motion.why, answer)
            try:
                return await answer
            finally:
                one.question = None

        became, why = 'failed', _UNEXPECTED
        try:
            await play(motion, consent)
            became, why = 'played', ''
        except NotPlayedError as error:
            became, why = 'not_played', str(error)
        except RigStoppedError as error:
            became, why = 'rig_stopped', str(error)
        except EndoscopeError as error:
            why = str(error)
        finally:
            one.plays, self._asking = False, None
            self._background.answer(json.dumps({'became': became, 'why': why}))

    def _answer(self, one: ShownInvestigation, go: bool) -> None:
        if one.question is not None and not one.question.answer.done():
            one.question.answer.set_result(go)

    def answer(self, question: str, go: bool) -> str:
        """Answer what the operator is asked."""
        for one in self._all.values():
            if one.question is not None and one.question.id == question:
                self._answer(one, go)
                return ''
        raise EndoscopeError('that is not asked any more')

    async def stop(self, name: str, halt: Callable[[], None]) -> str:
        """End one that is under way, so that it can be continued; `halt` ends a motion."""
        one = self._all.get(name)
        if one is None or not one.running:
            raise EndoscopeError(f'no investigation {name} is under way')
        if one.question is not None:
            self._answer(one, False)
        elif one.plays:
            halt()
        else:
            await self._background.close()
        return ''

    async def close(self) -> None:
        """Withdraw open questions, and wait until the motion being played has ended."""
        for one in self._all.values():
            self._answer(one, False)
        if self._asking is not None:
            await asyncio.wait({self._asking})
