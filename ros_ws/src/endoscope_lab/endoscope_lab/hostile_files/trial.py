"""`endoscope bench files`: what the readers do with damaged and crafted files."""

import argparse
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Future, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Protocol

import numpy as np
from numpy.random import Generator

from endoscope_core.errors import EndoscopeError, printable
from endoscope_core.workers import worker_pool
from endoscope_lab.bench import require_known, table_head, table_row
from endoscope_lab.hostile_files.mcap_case import McapCase
from endoscope_lab.hostile_files.text_case import (
    cells_case,
    command_case,
    mapping_case,
    metadata_case,
    plant_case,
    table_case,
)


def run(args: argparse.Namespace) -> int:
    """Print a row for each kind; return 1 if a file did more than it may."""
    require_known('kind', args.only or (), KINDS)
    print(table_head('kind', 'cases', *OUTCOMES, 'peak memory [MB]', 'longest [s]'))
    good = True
    for kind in args.only or KINDS:
        found = Outcomes(kind)
        for batch in try_files(kind, args.cases, args.seed, args.jobs):
            found.add(batch)
            done = f'\r{kind}: {found.counts.total()} of {args.cases}'
            print(done, end='', file=sys.stderr, flush=True)
        print(file=sys.stderr)
        print(found, flush=True)
        for number, what in found.bad:
            print(f'{kind} {number}: {what}', file=sys.stderr)
        good = good and found.good
    return 0 if good else 1


MEMORY = 2_000_000_000
"""Bytes that a process may take."""
SECONDS = 60
"""Time that a file may take."""
ONE_LINE, RIGHT, TRACEBACK = 'one line', 'correct', 'traceback'
OVER_MEMORY, OVER_TIME, WRONG = 'over memory', 'over time', 'wrong data'
OUTCOMES = (ONE_LINE, RIGHT, TRACEBACK, OVER_MEMORY, OVER_TIME, WRONG)
GOOD = (ONE_LINE, RIGHT)


def _weights_case(folder: Path) -> 'HostileCase':
    # Its libraries are no part of what other kinds take.
    from endoscope_lab.hostile_files.weights_case import WeightsCase

    return WeightsCase(folder)


KINDS: dict[str, Callable[[Path], 'HostileCase']] = {
    'mcap': McapCase,
    'metadata.yaml': metadata_case,
    'plant.yaml': plant_case,
    'cells.yaml': cells_case,
    'mapping.yaml': mapping_case,
    'command CSV': command_case,
    'weights': _weights_case,
    'text table': table_case,
}
_BATCH = 50


class HostileCase(Protocol):
    """A kind of file in a folder of its own."""

    def spoil(self, rng: Generator) -> None:
        """Write the next case."""

    def read(self) -> bool:
        """Read it with all that reads such files; tell whether what came out is right."""
        ...


@dataclass
class Outcomes:
    """What became of files of one kind of `KINDS`."""

    kind: str
    counts: Counter[str] = field(default_factory=Counter)  # files by outcome, one of `OUTCOMES`
    peak: int = 0  # most memory that a process took, in bytes, with its libraries
    longest: float = 0.0  # longest time that a file took, in s
    # The first files that ended otherwise than they must: number and what happened.
    bad: list[tuple[int, str]] = field(default_factory=list)

    @property
    def good(self) -> bool:
        """Whether every file ended in one line or a correct answer."""
        return not set(self.counts) - set(GOOD)

    def add(self, other: 'Outcomes') -> None:
        """Take over what became of other files of the kind."""
        self.counts += other.counts
        self.peak = max(self.peak, other.peak)
        self.longest = max(self.longest, other.longest)
        self.bad = sorted([*self.bad, *other.bad])[:20]

    def __str__(self) -> str:
        cells = [self.kind, self.counts.total(), *(self.counts[each] for each in OUTCOMES)]
        cells += [f'{self.peak / 1e6:.0f}', f'{self.longest:.1f}']
        return table_row(*cells)


class _OvertimeError(BaseException):
    """Not an `Exception`, so that no reader takes it for a flaw of the file."""


def try_files(kind: str, cases: int, seed: int, jobs: int) -> Iterator[Outcomes]:
    """Try so many files of one of `KINDS`; yield what became of each batch."""
    # A file depends on its kind, its number and the seed only.
    with worker_pool(jobs) as pool:
        batches: dict[Future[Outcomes], range] = {}
        for first in range(0, cases, _BATCH):
            numbers = range(first, min(first + _BATCH, cases))
            batches[pool.submit(_batch, kind, numbers, seed)] = numbers
        for done in as_completed(batches):
            try:
                yield done.result()
            except BrokenProcessPool as error:
                raise EndoscopeError(
                    f'a process died over {kind}, one of the files {batches[done]}'
                ) from error


def _batch(kind: str, numbers: range, seed: int) -> Outcomes:
    with tempfile.TemporaryDirectory() as folder:
        case = KINDS[kind](Path(folder))
        _limit_memory()
        outcomes = Outcomes(kind)
        for number in numbers:
            rng = np.random.default_rng([seed, list(KINDS).index(kind), number])
            case.spoil(rng)
            began = time.process_time()
            outcome, why = _tried(case)
            outcomes.longest = max(outcomes.longest, time.process_time() - began)
            outcomes.counts[outcome] += 1
            if outcome not in GOOD:
                outcomes.bad.append((number, f'{outcome}: {why}'))
        outcomes.peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return outcomes


def _limit_memory() -> None:
    """Allow `MEMORY` in all: what is in use now, and address space for the rest."""
    # Libraries map files of several gigabytes of which they never use most, so that address space
    # as such says little.
    mapped, resident = (
        int(pages) * resource.getpagesize()
        for pages in Path('/proc/self/statm').read_text().split()[:2]
    )
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (mapped - resident + MEMORY, hard))


def _tried(case: HostileCase) -> tuple[str, str]:
    def ring(_signum: int, _frame: FrameType | None) -> None:
        raise _OvertimeError

    previous = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        with warnings.catch_warnings():
            # A warning of numpy is a second line on the console.
            warnings.simplefilter('error')
            right = case.read()
    except EndoscopeError as error:
        line = str(error)
        said = line and line == printable(line)
        return (ONE_LINE if said else TRACEBACK), repr(line)
    except MemoryError:
        return OVER_MEMORY, traceback.format_exc(limit=-3)
    except _OvertimeError:
        return OVER_TIME, traceback.format_exc(limit=-3)
    except Exception:  # noqa: BLE001 (whatever it is, it is what is looked for)
        return TRACEBACK, traceback.format_exc(limit=-3)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, previous)
    return (RIGHT, '') if right else (WRONG, 'what came out is not what was recorded')
