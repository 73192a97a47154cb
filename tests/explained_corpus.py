"""Eight recordings that are explained once for all tests, until a source changes.

A test asks `corpus` for them, or explains one of their bags again, which takes no time. Whatever
else would be explained by the engine is refused, unless the test has the mark `engine`.
"""

import fcntl
import hashlib
import pickle
import shutil
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from short_bags import PLANT, one_joint, write_short_bag

from endoscope_core.physics import EffectSpec, JointParameters, PlantDescription
from endoscope_core.physics.description import TermSpec
from endoscope_explain import many_bags, pipeline
from endoscope_explain.case import ExplainedCase, Sources
from endoscope_explain.recording import RigRecording

WORKSPACE = Path(__file__).parents[1] / 'ros_ws'
KEPT = WORKSPACE / 'build' / 'explained'
GAIN = EffectSpec('load_cell_gain', 'bend_x', {'gain': 0.8, 'wire': 1.0})
STOP = EffectSpec('joint_stop', 'bend_x', {'angle_rad': 0.12})
OTHER = JointParameters(wire_stiffness=3300.0, capstan_exponent=0.83)
LAW = TermSpec('bend_x', 'exponent_of_angle', '0.4*sin(4*q)')


@dataclass(frozen=True)
class Made:
    """How a recording of the corpus is made, and explained."""

    rig: PlantDescription = PLANT
    bag: Mapping[str, Any] = ()  # more arguments of `write_short_bag`
    sources: Mapping[str, Any] = ()  # more of `Sources`
    with_: str = ''  # what is explained together with it, by one physics


CORPUS = {
    'sound': Made(),
    'other_numbers': Made(replace(PLANT, joints={'bend_x': OTHER})),
    'stopped': Made(one_joint(STOP), {'seed': 2}),
    'cell': Made(one_joint(GAIN)),
    'unknown': Made(replace(PLANT, terms=(LAW,)), {'duration': 7.0}, {'effects': 1}),
    'two_joints': Made(PlantDescription(effects=(STOP,))),
    'again': Made(bag={'seed': 5}, with_='sound'),
    'degrees': Made(one_joint(GAIN), {'tracker_unit': np.pi / 180.0}),
}


class Corpus:
    """Bags and explanations, kept under the hash of what they are made by."""

    def __init__(self) -> None:
        self._may_explain = False
        self._physics_of_all, self._explain = many_bags.physics_of_all, pipeline.explain_recording
        self._folder = KEPT / _hash_of_sources()
        if not self._folder.exists():
            shutil.rmtree(KEPT, ignore_errors=True)
        self._folder.mkdir(parents=True, exist_ok=True)

    def bag(self, name: str) -> Path:
        """Bag of a recording, which was explained."""
        self.case(name)
        return self._bag(name)

    def case(self, name: str) -> ExplainedCase:
        """A recording of the corpus, explained."""
        self._may_explain, one = True, CORPUS[name]
        try:
            sources = [
                Sources(
                    self._bag(n),
                    described(one.rig),
                    quick=True,
                    jobs=1,
                    same_physics=bool(one.with_),
                    **dict(one.sources),
                )
                for n in (name, one.with_)
                if n
            ]
            return many_bags.explained_cases(sources)[0]
        finally:
            self._may_explain = False

    def explain_recording(
        self, recording: RigRecording, plant: PlantDescription, **options: Any
    ) -> Any:
        """Explain as the engine does, once."""
        jobs, tell = options.pop('jobs', 2), options.pop('progress', None) or (lambda _: None)
        # The engine reads no words.
        unnamed = replace(recording, name='', notes=())

        def explain(tell: Callable[[str], None]) -> Any:
            return self._explain(recording, plant, **options, jobs=jobs, progress=tell)

        return self._once(recording.name, [unnamed, plant, options], explain, tell)

    def physics_of_all(self, sources: Any, tell: Callable[[str], None]) -> Any:
        """Choose effects for several recordings as the engine does, once."""
        key = [
            (_content(one.bag), one.plant, one.band, one.effects, one.without) for one in sources
        ]

        def explain(tell: Callable[[str], None]) -> Any:
            return self._physics_of_all(sources, tell)

        return self._once('several recordings', key, explain, tell)

    def _bag(self, name: str) -> Path:
        path = self._folder / f'{name}.mcap'
        with _locked(path):
            if not path.exists():
                made = CORPUS[name]
                part = write_short_bag(
                    self._folder / f'{name}_part.mcap', made.rig, **dict(made.bag)
                )
                part.rename(path)
        return path

    def _once(
        self,
        name: str,
        key: object,
        explain: Callable[[Callable[[str], None]], Any],
        tell: Callable[[str], None],
    ) -> Any:
        path = self._folder / f'{_digest(key)}.pickle'
        with _locked(path):
            if not path.exists():
                assert self._may_explain, (
                    f'{name} would be explained by the engine: take a recording of '
                    'explained_corpus.CORPUS, or mark the test `engine`'
                )
                said: list[str] = []
                found = explain(said.append)
                path.with_suffix('.part').write_bytes(pickle.dumps((said, found)))
                path.with_suffix('.part').rename(path)
        said, found = pickle.loads(path.read_bytes())
        for text in said:
            tell(text)
        return found


def described(rig: PlantDescription) -> PlantDescription:
    """What is known of a rig: its joints."""
    return PlantDescription({joint: JointParameters() for joint in rig.joints})


@pytest.fixture(scope='session')
def kept_corpus() -> Corpus:
    return Corpus()


@pytest.fixture
def corpus(
    kept_corpus: Corpus, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Corpus:
    """The corpus, in place of the engine where a test has not the mark of it."""
    if request.node.get_closest_marker('engine'):
        return kept_corpus
    monkeypatch.setattr(pipeline, 'explain_recording', kept_corpus.explain_recording)
    monkeypatch.setattr(many_bags, 'physics_of_all', kept_corpus.physics_of_all)
    # Processes of their own would know nothing of it.
    monkeypatch.setattr(many_bags, 'worker_pool', ThreadPoolExecutor)
    return kept_corpus


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    with path.with_suffix('.lock').open('w') as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _hash_of_sources() -> str:
    files = [
        WORKSPACE / 'requirements.lock',
        *Path(__file__).parent.glob('*_bags.py'),
        Path(__file__),
    ]
    for package in ('core', 'bags', 'explain'):
        name = f'endoscope_{package}'
        files += (p for p in (WORKSPACE / 'src' / name / name).rglob('*') if p.is_file())
    found = hashlib.sha256()
    for file in sorted(f for f in files if f.suffix != '.pyc'):
        found.update(file.read_bytes())
    return found.hexdigest()[:16]


def _content(bag: Path) -> list[bytes]:
    return [p.read_bytes() for p in (sorted(bag.glob('*.mcap')) if bag.is_dir() else [bag])]


def _digest(of: object) -> str:
    found = hashlib.sha256()

    def add(one: object) -> None:
        if isinstance(one, np.ndarray):
            found.update(f'{one.dtype}{one.shape}'.encode() + np.ascontiguousarray(one).tobytes())
        elif is_dataclass(one) and not isinstance(one, type):
            add([type(one).__name__, *(getattr(one, field.name) for field in fields(one))])
        elif isinstance(one, Mapping):
            add(sorted(one.items()))
        elif isinstance(one, list | tuple):
            found.update(b'[')
            for each in one:
                add(each)
            found.update(b']')
        else:
            found.update(repr(one).encode() + b',')

    add(of)
    return found.hexdigest()[:32]
