"""What benches on drawn cases share: which cases, how many side by side, and where rows go."""

import argparse
import json
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import asdict
from pathlib import Path
from typing import Any

from endoscope_bringup.subcommands import COUNT, seed
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


def add_seeds(parser: argparse.ArgumentParser, what: str) -> None:
    """Add `--seeds`."""
    parser.add_argument('--seeds', type=seeds, default=range(1, 4), metavar='A-B', help=what)


def add_jobs(parser: argparse.ArgumentParser, default: int = 1) -> None:
    """Add `--jobs`."""
    parser.add_argument(
        '--jobs', type=COUNT, default=default, metavar='N', help=f'side by side ({default})'
    )


def side_by_side(
    jobs: int, function: Callable[..., Any], calls: Sequence[tuple[Any, ...]]
) -> Iterator[tuple[int, Any]]:
    """Yield how many calls are done, and what each returned, as they are done."""
    from concurrent.futures import as_completed

    from endoscope_core.worker_pool import worker_pool

    with worker_pool(jobs) as pool:
        futures = [pool.submit(function, *call) for call in calls]
        for done, future in enumerate(as_completed(futures), 1):
            yield done, future.result()


def require_known(kind: str, names: Collection[str], known: Collection[str]) -> None:
    """Raise EndoscopeError for a name that is not known."""
    for name in names:
        if name not in known:
            raise EndoscopeError(f"no {kind} '{name}'; known are {', '.join(known)}")


def of_cases(
    jobs: int, cases: Sequence[tuple[str, int]], function: Callable[..., Any], *before: Any
) -> Iterator[tuple[tuple[str, int], Future[Any]]]:
    """Yield each case with `function(*before, stratum, seed)`, as they are done."""
    from concurrent.futures import as_completed

    from endoscope_core.worker_pool import worker_pool

    with worker_pool(jobs) as pool:
        futures = {pool.submit(function, *before, *case): case for case in cases}
        for future in as_completed(futures):
            yield futures[future], future


def write_rows(file: Path | None, rows: Sequence[Any]) -> None:
    """Write rows, which are dataclasses, as JSON where a file was given."""
    from endoscope_core.atomic_output import write_text

    if file is not None:
        write_text(file, json.dumps([asdict(row) for row in rows], indent=1) + '\n')


def seeds(text: str) -> range:
    """Read a range of seeds, `A-B` with both ends, or one; ArgumentTypeError if it is none."""
    found = re.fullmatch(r'(\d+)(?:-(\d+))?', text)
    if not found or int(found[2] or found[1]) < int(found[1]):
        raise argparse.ArgumentTypeError(f'{text!r} are no seeds: give 1-20, or 7')
    return range(seed(found[1]), seed(found[2] or found[1]) + 1)
