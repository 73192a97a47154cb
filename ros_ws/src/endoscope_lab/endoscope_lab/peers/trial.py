"""`endoscope bench peers`: what other people's methods say of the rigs of `bench concealed`."""

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_core.errors import EndoscopeError
from endoscope_core.workers import worker_pool
from endoscope_lab.bench import require_known, side_by_side, table_head, table_row
from endoscope_lab.concealed.judge import Statement, judged, statements
from endoscope_lab.concealed.strata import STRATA, drawn_case
from endoscope_lab.concealed.trial import explanation_of
from endoscope_lab.peers import library, symbolic
from endoscope_lab.peers.localised_discrepancy import by_lisdd, lisdd_example
from endoscope_lab.peers.mujoco_sysid import by_mujoco, mujoco_example
from endoscope_lab.peers.problem import OwnExample, Problem, Reply, problem_of
from endoscope_lab.peers.regions import (
    Intervals,
    Overlap,
    changed_windows,
    explained_intervals,
    pooled,
    windows_in,
)

OURS = 'endoscope explain'
Peer = tuple[str, Callable[[Problem], Reply | Statement | None], Callable[[], OwnExample]]
"""Its package (empty where it is written here), what it says of a problem, its own example."""

PEERS: dict[str, Peer] = {
    'forward selection': ('', library.by_forward_selection, library.forward_selection_example),
    'ensemble SINDy': ('pysindy', library.by_sindy, library.sindy_example),
    'Operon': ('pyoperon', symbolic.by_operon, symbolic.operon_example),
    'LISDD': ('', by_lisdd, lisdd_example),
    'mujoco.sysid': ('mujoco', by_mujoco, mujoco_example),
}


def run(args: argparse.Namespace) -> int:
    """Print a line for each answer, then the table; return 1 if an own example fails."""
    names = args.peer or list(PEERS)
    require_known('peer', names, PEERS)
    require_known('stratum', args.stratum, STRATA)
    require_installed(names)
    with worker_pool(args.jobs) as pool:
        shown = dict(zip(names, pool.map(example, names), strict=True))
    cases = [(names, name, seed) for name in args.stratum for seed in args.seeds]
    found = []
    for _, future in side_by_side(args.jobs, answers, cases):
        found += future.result()
        print('\n'.join(answer.line() for answer in future.result()), flush=True)
    print('\n' + table(shown, found))
    return 0 if all(own.works for own in shown.values()) else 1


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
    judged_by = ('named first', 'right place', 'false names', 'regions, F1', 's, median')
    lines = [table_head('peer', 'version', 'example', 'required', 'obtained', *judged_by)]
    for name, own in [*shown.items(), (OURS, OwnExample('', '', '', True))]:
        of_it = [each for each in found if each.peer == name]
        counts = (sum(getattr(a, what) for a in of_it) for what in ('first', 'place', 'false'))
        gave = own.gave if own.works else f'{own.gave} FAILS'
        seconds = f'{np.median([a.seconds for a in of_it]):.1f}' if of_it else '-'
        where = [a.regions for a in of_it if a.regions]
        f1 = f'{pooled(where).f1:.2f}' if where else '-'
        package = PEERS[name][0] if name in PEERS else ''
        version_ = f'{package} {_version(package)}'.strip()
        lines.append(table_row(name, version_, own.what, own.must, gave, *counts, f1, seconds))
    every = [a.regions for a in found if a.peer == OURS and a.regions]
    if every:
        whole = f'{pooled(every).f1_of_all:.2f}'
        lines.append(f'\nF1 if every window of every recording were flagged: {whole}')
    return '\n'.join(lines)


def _version(package: str) -> str:
    """Of an installed package; of none, that there is nothing to install; empty if missing."""
    try:
        return version(package) if package else 'here'
    except PackageNotFoundError:
        return ''
