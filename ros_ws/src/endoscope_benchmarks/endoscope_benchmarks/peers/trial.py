"""Every peer on its own example and on the cases, regions included, and the table of them."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from endoscope_benchmarks.concealed.judge import Case, Statement, judged, statements
from endoscope_benchmarks.concealed.readings import in_noise, read
from endoscope_benchmarks.concealed.strata import drawn_case
from endoscope_benchmarks.concealed.trial import explanation_of
from endoscope_benchmarks.peers import regression_on_library as library
from endoscope_benchmarks.peers import symbolic
from endoscope_benchmarks.peers.empirical_risk import by_empirical_risk, empirical_risk_example
from endoscope_benchmarks.peers.localised_discrepancy import by_lisdd, lisdd_example
from endoscope_benchmarks.peers.mujoco_sysid import by_mujoco, mujoco_example
from endoscope_benchmarks.peers.problem import OwnExample, Problem, Reply, problem_of
from endoscope_benchmarks.peers.universal_equation import by_network, network_example
from endoscope_core.errors import EndoscopeError
from endoscope_explain.explanation import Explanation, Verdict
from endoscope_explain.locate.excess import WINDOW_S
from endoscope_explain.locate.locating import locate_effects, locate_unknown

Mask = NDArray[np.bool_]
Intervals = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Overlap:
    """Windows of `WINDOW_S` that are in a method's regions, and that should be."""

    hits: int
    extra: int
    missed: int
    all: int

    @staticmethod
    def of(said: Mask, true: Mask) -> 'Overlap':
        """Compare windows (W,) that are said with those that are true."""
        hits, extra, missed = (int(np.sum(w)) for w in (said & true, said & ~true, ~said & true))
        return Overlap(hits, extra, missed, len(true))

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 1 where there is nothing to find or to say."""
        found = 2 * self.hits + self.extra + self.missed
        return 2 * self.hits / found if found else 1.0

    @property
    def f1_of_all(self) -> float:
        """The same, had every window been said."""
        true = self.hits + self.missed
        return 2 * true / (true + self.all) if self.all else 1.0


def pooled(overlaps: Iterable[Overlap]) -> Overlap:
    """All windows of several cases: a false region where nothing is concealed counts too."""
    every = np.array([(o.hits, o.extra, o.missed, o.all) for o in overlaps])
    hits, extra, missed, count = map(int, every.sum(axis=0))
    return Overlap(hits, extra, missed, count)


def changed_windows(case: Case) -> Mask:
    """Windows (W,) in which the laws change some signal by more (rms) than its noise."""
    # That of the described sensors, in readings of 10 ms as a report judges them.
    command, sensors = case.recording.command.values, case.described.sensors
    bare, true = (in_noise(read(p, command).signals(), sensors) for p in (case.bare, case.true))
    end = case.recording.duration
    changed = np.zeros(_count(end), bool)
    for without, with_it in zip(bare, true, strict=True):
        window = (np.arange(len(without)) * end / len(without) / WINDOW_S).astype(int)
        energy = np.bincount(window, (with_it - without) ** 2, len(changed))
        changed |= energy > np.bincount(window, minlength=len(changed))
    return changed


def windows_in(intervals: Intervals, end: float) -> Mask:
    """Windows (W,) up to `end` s whose middle lies in one of the intervals in s."""
    middle = WINDOW_S * (np.arange(_count(end)) + 0.5)
    within = [(low <= middle) & (middle < high) for low, high in intervals]
    return np.any(within, axis=0) if within else np.zeros(len(middle), bool)


def explained_intervals(case: Case, said: Explanation) -> Intervals:
    """Intervals in s at which an explanation says that something is missing."""
    places = locate_effects(case.recording, said.augmented, said.effects)
    if said.verdict is Verdict.UNKNOWN_PHYSICS:
        places += locate_unknown(case.recording, said)
    return [interval for place in places for interval in place.intervals]


def _count(end: float) -> int:
    return int(np.ceil(end / WINDOW_S))


OURS = 'endoscope explain'
Peer = tuple[str, Callable[[Problem], Reply | Statement | None], Callable[[], OwnExample]]
"""Its package (empty where it is written here), what it says of a problem, its own example."""

PEERS: dict[str, Peer] = {
    'forward selection': ('', library.by_forward_selection, library.forward_selection_example),
    'ensemble SINDy': ('pysindy', library.by_sindy, library.sindy_example),
    'Operon': ('pyoperon', symbolic.by_operon, symbolic.operon_example),
    'gp-elite': ('gp-elite', symbolic.by_elite, symbolic.elite_example),
    'Bayesian symbolic': ('autora-theorist-bms', symbolic.by_bayesian, symbolic.bayesian_example),
    'universal equation': ('', by_network, network_example),
    'EMD comparison': ('emdcmp', by_empirical_risk, empirical_risk_example),
    'LISDD': ('', by_lisdd, lisdd_example),
    'mujoco.sysid': ('mujoco', by_mujoco, mujoco_example),
}


@dataclass(frozen=True)
class Answer:
    """What one peer said of one case, and how right it is: see `Judgement`."""

    peer: str
    stratum: str
    seed: int
    said: str
    first: bool
    place: bool
    false: int
    seconds: float  # without refitting the nominal plant, which all peers need
    regions: Overlap | None  # None from a peer that says nothing of where
    report: str

    def line(self) -> str:
        """The answer in one line."""
        right = 'right' if self.first else 'place' if self.place else 'WRONG'
        case = f'{self.stratum:17s}{self.seed:4d}'
        where = f', regions F1 {self.regions.f1:.2f}' if self.regions else ''
        report = f' ({self.report})' if self.report else ''
        said = f'{self.said}{report}{where}'
        return f'{case}  {self.peer:19s}{right:6s}{self.seconds:7.1f} s  {said}'


def require_installed(names: Sequence[str]) -> None:
    """Raise EndoscopeError for peers that are not installed."""
    missing = [PEERS[name][0] for name in names if not _version(PEERS[name][0])]
    if missing:
        raise EndoscopeError(
            f'{", ".join(missing)} not installed: run `make -C ros_ws peers`, or choose others '
            'with --peer'
        )


def answers(names: Sequence[str], stratum: str, seed: int) -> list[Answer]:
    """Ask peers, and last ourselves, about one case on one core."""
    case, found = drawn_case(stratum, seed), []
    true = changed_windows(case)

    def answer(
        peer: str,
        said: Sequence[Statement],
        intervals: Intervals | None,
        seconds: float,
        report: str = '',
    ) -> None:
        right = judged(case.laws, said, case.also)
        regions = None
        if intervals is not None:
            regions = Overlap.of(windows_in(intervals, case.recording.duration), true)
        found.append(
            Answer(
                peer, stratum, seed,
                ' + '.join(f'{each.name}@{each.joint}' for each in said) or 'nothing',
                right.first, right.place, right.false, seconds, regions, report,
            )
        )  # fmt: skip

    with threadpool_limits(1):
        problem = problem_of(case)
        for name in names:
            begun = time.monotonic()
            reply = PEERS[name][1](problem)
            seconds = time.monotonic() - begun
            if not isinstance(reply, Reply):
                reply = Reply(reply)
            said = [] if reply.statement is None else [reply.statement]
            answer(name, said, reply.intervals, seconds, reply.report)
    own, seconds = explanation_of(case)
    answer(OURS, statements(own), explained_intervals(case, own), seconds)
    return found


def example(name: str) -> OwnExample:
    """Run a peer's own example on one core."""
    with threadpool_limits(1):
        return PEERS[name][2]()


def table(shown: Mapping[str, OwnExample], found: Sequence[Answer]) -> str:
    """A line for each peer, and one for ourselves."""
    ours = OwnExample('', '', '', True)
    rows: list[tuple[str, ...]] = [
        (
            *('peer', 'own example', 'it must give', 'it gave', 'first', 'place', 'false'),
            *('regions, F1', 's'),
        )
    ]
    for name, own in [*shown.items(), (OURS, ours)]:
        of_it = [each for each in found if each.peer == name]
        counts = (sum(getattr(a, what) for a in of_it) for what in ('first', 'place', 'false'))
        gave = own.gave if own.works else f'{own.gave} FAILS'
        seconds = f'{np.median([a.seconds for a in of_it]):.1f}' if of_it else '-'
        where = [a.regions for a in of_it if a.regions]
        f1 = f'{pooled(where).f1:.2f}' if where else '-'
        rows.append((name, own.what, own.must, gave, *map(str, counts), f1, seconds))
    widths = [max(map(len, column)) + 2 for column in zip(*rows, strict=True)]
    lines = [''.join(map(str.ljust, row, widths)).rstrip() for row in rows]
    every = [a.regions for a in found if a.peer == OURS and a.regions]
    if every:
        lines.append(f'regions, F1 of the whole of every recording: {pooled(every).f1_of_all:.2f}')
    return '\n'.join(lines)


def versions(names: Sequence[str]) -> str:
    """Peers' packages with their versions, in a line."""
    return ', '.join(f'{p} {_version(p)}' for name in names if (p := PEERS[name][0]))


def _version(package: str) -> str:
    """Of an installed package; of none, that there is nothing to install; empty if missing."""
    try:
        return version(package) if package else 'here'
    except PackageNotFoundError:
        return ''
