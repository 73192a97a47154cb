"""Explanations of recordings on this machine, each in its own process of low priority."""

import json
import secrets
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from endoscope_bags.errors import BagError
from endoscope_bags.metadata import bag_files
from endoscope_console.access import REPORTS
from endoscope_console.background import BackgroundCommand
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import PlantDescription
from endoscope_core.physics.plant_file import save_plant

REPORT_FILE = 'report.html'
NOMINAL = 'nominal_plant'
"""Name of the plant that a graph simulates where no file describes it."""
_RESULT_FILE = 'report.json'
EXPERIMENT_FILE = 'next_experiment.csv'
_STEPS = 7
"""That `endoscope explain` names on the way, for two joints."""
_LISTED = 20
_REMARKS = ('note:', 'audit:')
_METADATA = 'metadata.yaml'
PLANT_FILE = 'plant.yaml'
"""The improved plant of an explanation."""


@dataclass
class ShownExplanation:
    """One recording being explained, or explained."""

    id: str  # by which a page refers to it
    bag: str  # name of the recording
    folder: Path  # where report and improved plant are
    secret: str  # part of the report's address that nobody can guess
    running: bool = True
    step: str = 'reading'  # what is being done
    progress: float = 0.0  # share that is done
    sentence: str = ''  # what was found; empty before
    error: str = ''  # why nothing was; empty where something was
    experiment: bool = False  # whether a further experiment was designed
    plant: str = ''  # by which it is explained
    report: str | None = None  # path of its address; None where there is none
    improved: str = ''  # name of the improved plant; empty where there is none

    def ended(self, sentence: str = '') -> None:
        """Read the result from its folder, with its own summary if the program printed none."""
        self.running, self.step, self.progress = False, '', 1.0
        try:
            result = json.loads((self.folder / _RESULT_FILE).read_text('utf-8'))
            self.sentence = sentence or _in_short(result)
            planned = result['next_experiment'] is not None
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            self.error = (
                f'{self.folder / _RESULT_FILE} is not the result of an explanation: {error}'
            )
            return
        self.experiment = planned and (self.folder / EXPERIMENT_FILE).is_file()
        if (self.folder / REPORT_FILE).is_file():
            self.report = f'{REPORTS}{self.secret}/{REPORT_FILE}'
        if (self.folder / PLANT_FILE).is_file():
            self.improved = f'{self.folder.name}/{PLANT_FILE}'

    def as_mapping(self) -> dict[str, Any]:
        """Its part of the state that pages receive."""
        keys = ('id', 'bag', 'plant', 'running', 'step', 'progress', 'sentence', 'report')
        values = {key: getattr(self, key) for key in (*keys, 'experiment', 'improved')}
        return values | {'error': self.error or None}


class Explanations:
    """Recordings of one folder, and what explains them."""

    def __init__(self, folder: Path, background: BackgroundCommand) -> None:
        self._folder, self._background = folder, background
        self._all: dict[str, ShownExplanation] = {}
        # Those that are there can be read again.
        found = sorted(folder.glob(f'*/{_RESULT_FILE}'), key=lambda file: file.stat().st_mtime)
        for file in found:
            self._new(file.parent.name, file.parent).ended()

    def as_list(self) -> list[dict[str, Any]]:
        """The last twenty in the state that pages receive, newest first."""
        return [one.as_mapping() for one in list(self._all.values())[: -_LISTED - 1 : -1]]

    def listing(self) -> dict[str, Any]:
        """Recordings with duration in s and size in bytes, newest first, and plants."""
        bags = [
            {'name': name, 'duration': _duration(path), 'size': _size(path)}
            for name, path in sorted(self._bags().items(), reverse=True)
        ]
        return {'bags': bags, 'plants': sorted(self._plants())}

    def _bags(self) -> dict[str, Path]:
        found = {}
        for path in self._folder.glob('*'):
            is_bag = (path / _METADATA).is_file() if path.is_dir() else path.suffix == '.mcap'
            if is_bag and not path.name.startswith('.'):
                found[path.name] = path
        return found

    def _plants(self) -> dict[str, Path]:
        found = {path.name: path for path in self._folder.glob('*.yaml')}
        # Others are added while a thread of the pool lists these.
        unfinished = {one.folder for one in tuple(self._all.values()) if one.running}
        for improved in self._folder.glob(f'*/{PLANT_FILE}'):
            if improved.parent not in unfinished:
                found[f'{improved.parent.name}/{PLANT_FILE}'] = improved
        return found

    def file_of(self, secret: str) -> Path | None:
        """The report whose address has this part; None for no report."""
        for one in self._all.values():
            if secrets.compare_digest(one.secret, secret) and one.report is not None:
                return one.folder / REPORT_FILE
        return None

    def experiment_of(self, name: str) -> Path:
        """File with the motion of the next experiment; EndoscopeError if there is none."""
        one = self._all.get(name)
        if one is None or not one.experiment:
            raise EndoscopeError(f'there is no experiment of an explanation {name}')
        return (one.folder / EXPERIMENT_FILE).resolve()

    async def begin(
        self,
        bag: str,
        plant: str | None,
        baseline: str | None,
        validate: str | None,
        own: str = '',
    ) -> Mapping[str, Any]:
        """Begin to explain a recording by a plant, the graph's own where none is named."""
        bags = self._bags()
        for name in (bag, baseline, validate):
            if name is not None and name not in bags:
                raise EndoscopeError(f'there is no recording {name} in {self._folder}')
        file = self.plant_file(plant, own)
        self._background.require_free()
        name = f'why-{bag.removesuffix(".mcap")}-{time.strftime("%Y%m%d-%H%M%S")}'
        one = self._new(bag, self._folder / name)
        one.plant = plant or own
        words = [str(bags[bag]), '--out', str(one.folder), '--jobs', '1']
        for option, chosen in (('--baseline', baseline), ('--validate', validate)):
            words += [option, str(bags[chosen])] if chosen is not None else []
        self._background.start(
            'another recording is being explained',
            self._explain(one, ['explain', *words, '--plant', str(file)]),
        )
        return {'explanation': one.id}

    def plant_file(self, plant: str | None, own: str = '') -> Path:
        """File of a plant that `listing` names; of the graph's own where that or none is named."""
        if plant is None or plant == own:
            return self._own_plant(own)
        plants = self._plants()
        if plant not in plants:
            raise EndoscopeError(f'there is no plant {plant} in {self._folder}')
        return plants[plant]

    def _own_plant(self, own: str) -> Path:
        """File of the graph's own plant; the nominal one is written beside the recordings."""
        file = self._folder / f'{NOMINAL}.yaml' if own == NOMINAL else Path(own)
        if own == NOMINAL and not file.exists():
            save_plant(PlantDescription(), file)
        if not file.is_file():
            why = f'{own} is not there' if own else 'the graph does not say which it simulates'
            raise EndoscopeError(f'name a plant: {why}')
        return file

    def _new(self, bag: str, folder: Path) -> ShownExplanation:
        one = ShownExplanation(f'e{len(self._all) + 1}', bag, folder, secrets.token_urlsafe(16))
        self._all[one.id] = one
        return one

    async def _explain(self, one: ShownExplanation, words: list[str]) -> None:
        output: list[str] = []
        done = 0

        def take_step(line: str) -> None:
            """Take a line with a step; the last line of a failure is its reason."""
            nonlocal done
            text = line.strip()
            if text and not text.startswith(_REMARKS):
                done += 1
                one.step, one.progress = text, min(done / _STEPS, 0.95)

        try:
            status = await self._background.run(words, output.append, take_step)
        except (OSError, ValueError) as error:
            one.running, one.error = False, f'it could not be followed: {error}'
            return
        if status:
            one.running, one.error = False, one.error or one.step
        else:
            one.ended(output[0] if output else '')

    async def cancel(self, name: str) -> str:
        """End one that is under way."""
        one = self._all.get(name)
        if one is None or not one.running:
            raise EndoscopeError(f'no explanation {name} is under way')
        one.error = 'cancelled'
        await self._background.close()
        return ''


def _in_short(result: Mapping[str, Any]) -> str:
    """The verdict of a result, and what it names."""
    effects = ', '.join(f'{effect["id"]} ({effect["joint"]})' for effect in result['effects'])
    return result['verdict'].replace('_', ' ') + (f': {effects}' if effects else '')


def _duration(path: Path) -> float | None:
    """Of a recording in s; None where its metadata do not say."""
    try:
        text = (path / _METADATA).read_text('utf-8')
        information = yaml.safe_load(text)['rosbag2_bagfile_information']
        return float(information['duration']['nanoseconds']) * 1e-9
    except (OSError, ValueError, KeyError, TypeError, yaml.YAMLError):
        return None


def _size(path: Path) -> int | None:
    """Of a recording in bytes; None where a file of it is missing."""
    try:
        return sum(file.stat().st_size for file in bag_files(path))
    except (OSError, BagError):
        return None
