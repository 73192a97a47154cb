"""Every peer on its own example and on the cases, and the table of them."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_benchmarks.concealed.judge import Judgement, Statement, judged
from endoscope_benchmarks.concealed.strata import drawn_case
from endoscope_benchmarks.concealed.trial import explained
from endoscope_benchmarks.peers import regression_on_library as library
from endoscope_benchmarks.peers import symbolic
from endoscope_benchmarks.peers.empirical_risk import by_empirical_risk, empirical_risk_example
from endoscope_benchmarks.peers.problem import OwnExample, Problem, problem_of
from endoscope_benchmarks.peers.universal_equation import by_network, network_example
from endoscope_core.errors import EndoscopeError

OURS = 'endoscope explain'
Peer = tuple[str, Callable[[Problem], Statement | None], Callable[[], OwnExample]]
"""Its package (empty where it is written here), what it says of a problem, its own example."""

PEERS: dict[str, Peer] = {
    'forward selection': ('', library.by_forward_selection, library.forward_selection_example),
    'ensemble SINDy': ('pysindy', library.by_sindy, library.sindy_example),
    'Operon': ('pyoperon', symbolic.by_operon, symbolic.operon_example),
    'gp-elite': ('gp-elite', symbolic.by_elite, symbolic.elite_example),
    'Bayesian symbolic': ('autora-theorist-bms', symbolic.by_bayesian, symbolic.bayesian_example),
    'universal equation': ('', by_network, network_example),
    'EMD comparison': ('emdcmp', by_empirical_risk, empirical_risk_example),
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

    def line(self) -> str:
        """The answer in one line."""
        right = 'right' if self.first else 'place' if self.place else 'WRONG'
        case = f'{self.stratum:17s}{self.seed:4d}'
        return f'{case}  {self.peer:19s}{right:6s}{self.seconds:7.1f} s  {self.said}'


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

    def answer(peer: str, said: Sequence[str], judged_as: Judgement, seconds: float) -> None:
        right = judged_as.first, judged_as.place, judged_as.false
        found.append(Answer(peer, stratum, seed, ' + '.join(said) or 'nothing', *right, seconds))

    with threadpool_limits(1):
        problem = problem_of(case)
        for name in names:
            begun = time.monotonic()
            statement = PEERS[name][1](problem)
            seconds = time.monotonic() - begun
            said = [] if statement is None else [statement]
            spoken = [f'{each.name}@{each.joint}' for each in said]
            answer(name, spoken, judged(case.laws, said, case.also), seconds)
    own = explained(stratum, seed)
    answer(OURS, own.said, own, own.seconds)
    return found


def example(name: str) -> OwnExample:
    """Run a peer's own example on one core."""
    with threadpool_limits(1):
        return PEERS[name][2]()


def table(shown: Mapping[str, OwnExample], found: Sequence[Answer]) -> str:
    """A line for each peer, and one for ourselves."""
    ours = OwnExample('', '', '', True)
    rows: list[tuple[str, ...]] = [
        ('peer', 'own example', 'it must give', 'it gave', 'first', 'place', 'false', 's')
    ]
    for name, own in [*shown.items(), (OURS, ours)]:
        of_it = [each for each in found if each.peer == name]
        counts = (sum(getattr(a, what) for a in of_it) for what in ('first', 'place', 'false'))
        gave = own.gave if own.works else f'{own.gave} FAILS'
        seconds = f'{np.median([a.seconds for a in of_it]):.1f}' if of_it else '-'
        rows.append((name, own.what, own.must, gave, *map(str, counts), seconds))
    widths = [max(map(len, column)) + 2 for column in zip(*rows, strict=True)]
    return '\n'.join(''.join(map(str.ljust, row, widths)).rstrip() for row in rows)


def versions(names: Sequence[str]) -> str:
    """Peers' packages with their versions, in a line."""
    return ', '.join(f'{p} {_version(p)}' for name in names if (p := PEERS[name][0]))


def _version(package: str) -> str:
    """Of an installed package; of none, that there is nothing to install; empty if missing."""
    try:
        return version(package) if package else 'here'
    except PackageNotFoundError:
        return ''
