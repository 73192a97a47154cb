"""What every bench does: options, work side by side, progress, rows of tables, and the machine."""

import argparse
import json
import os
import platform
import re
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import asdict
from pathlib import Path
from typing import Any

from endoscope_bringup.subcommands import COUNT, seed, within
from endoscope_core.errors import EndoscopeError


def add_case_options(parser: argparse.ArgumentParser, strata: Sequence[str] | None = None) -> None:
    """Add the options that say which cases, by default those of all strata."""
    parser.add_argument(
        '--stratum',
        nargs='+',
        metavar='NAME',
        default=strata,
        help=f'kinds of cases (default: {" ".join(strata or ["all"])})',
    )
    add_seeds(parser, 'of the cases (default: 1-3)')
    add_jobs(parser)
    parser.add_argument('--json', type=Path, metavar='FILE', help='file for all rows')


def add_seeds(
    parser: argparse.ArgumentParser, what: str, option: str = '--seeds', last: int = 3
) -> None:
    """Add a range of seeds, by default from 1."""
    parser.add_argument(option, type=seeds, default=range(1, last + 1), metavar='A-B', help=what)


def add_jobs(parser: argparse.ArgumentParser, default: int = 1) -> None:
    """Add `--jobs`."""
    parser.add_argument(
        '--jobs', type=COUNT, default=default, metavar='N', help=f'side by side ({default})'
    )


def add_seconds(
    parser: argparse.ArgumentParser, default: float, what: str, option: str = '--seconds'
) -> None:
    """Add a duration in s."""
    parser.add_argument(
        option,
        type=within(0.0, 86400.0, float),
        default=default,
        help=f'{what} (default: %(default)g)',
    )


def add_only(parser: argparse.ArgumentParser, what: str) -> None:
    """Add `--only`; see `chosen`."""
    parser.add_argument(
        '--only', nargs='+', metavar=what.upper(), help=f'{what}s to try (default: all)'
    )


def chosen[T](kind: str, names: Sequence[str] | None, known: Mapping[str, T]) -> dict[str, T]:
    """What was chosen of what is known, all by default; EndoscopeError for an unknown name."""
    require_known(kind, names or (), known)
    return {name: known[name] for name in names or known}


def require_known(kind: str, names: Collection[str], known: Collection[str]) -> None:
    """Raise EndoscopeError for a name that is not known."""
    for name in names:
        if name not in known:
            raise EndoscopeError(f"no {kind} '{name}'; known are {', '.join(known)}")


def side_by_side[C: tuple[Any, ...]](
    jobs: int, function: Callable[..., Any], calls: Sequence[C]
) -> Iterator[tuple[C, Future[Any]]]:
    """Yield each call with its future, as they are done."""
    from concurrent.futures import as_completed

    from endoscope_core.workers import worker_pool

    with worker_pool(jobs) as pool:
        futures = {pool.submit(function, *call): call for call in calls}
        for future in as_completed(futures):
            yield futures[future], future


def report(line: str) -> None:
    """Say on stderr how far it has come."""
    print(line, file=sys.stderr, flush=True)


def table_row(*cells: object) -> str:
    """A line of a Markdown table."""
    return f'| {" | ".join(map(str, cells))} |'


def table_head(*columns: str) -> str:
    """The two lines above the rows of a Markdown table."""
    return f'{table_row(*columns)}\n|{"---|" * len(columns)}'


def write_rows(file: Path | None, rows: Sequence[Any]) -> None:
    """Write rows, which are dataclasses, as JSON where a file was given."""
    from endoscope_core.atomic_output import write_text

    if file is not None:
        write_text(file, json.dumps([asdict(row) for row in rows], indent=1) + '\n')


def seeds(text: str) -> range:
    """Read a range of seeds, `A-B` with both ends, or one; ArgumentTypeError if it is none."""
    found = re.fullmatch(r'(\d+)(?:-(\d+))?', text)
    if not found or int(found[2] or found[1]) < int(found[1]):
        raise argparse.ArgumentTypeError(f'{text!r} are not seeds: give 1-20, or 7')
    return range(seed(found[1]), seed(found[2] or found[1]) + 1)


def today_and_machine() -> str:
    """Date, cores and processor, which a table is headed by."""
    processor = platform.processor() or platform.machine()
    return f'{time.strftime("%Y-%m-%d")}, {os.cpu_count()} cores, {processor}'


def cpu_seconds(pid: int) -> float:
    """User and system time in s that a running process has used so far (Linux ``/proc``)."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
