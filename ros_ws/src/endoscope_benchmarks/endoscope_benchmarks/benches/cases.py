"""What benches on drawn cases share: which cases, how many side by side, and where rows go."""

import argparse
import json
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import asdict
from pathlib import Path
from typing import Any

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
    parser.add_argument('--jobs', type=int, default=1, metavar='N', help='cases side by side (1)')
    parser.add_argument('--json', type=Path, metavar='FILE', help='file for all rows')


def add_seeds(parser: argparse.ArgumentParser, what: str) -> None:
    """Add `--seeds`."""
    parser.add_argument('--seeds', type=seeds, default=range(1, 4), metavar='A-B', help=what)


def require_known(kind: str, names: Collection[str], known: Collection[str]) -> None:
    """Raise EndoscopeError for a name that is not known."""
    for name in names:
        if name not in known:
            raise EndoscopeError(f"no {kind} '{name}'; known are {', '.join(known)}")


def of_cases(
    args: argparse.Namespace, strata: Sequence[str], function: Callable[..., Any], *before: Any
) -> Iterator[tuple[tuple[str, int], Future[Any]]]:
    """Yield each case with `function(*before, stratum, seed)`, as they are done."""
    from concurrent.futures import as_completed

    from endoscope_core.worker_pool import worker_pool

    cases = [(name, seed) for name in strata for seed in args.seeds]
    with worker_pool(args.jobs) as pool:
        futures = {pool.submit(function, *before, *case): case for case in cases}
        for future in as_completed(futures):
            yield futures[future], future


def write_rows(file: Path | None, rows: Sequence[Any]) -> None:
    """Write rows, which are dataclasses, as JSON where a file was given."""
    from endoscope_core.atomic_output import write_text

    if file is not None:
        write_text(file, json.dumps([asdict(row) for row in rows], indent=1) + '\n')


def seeds(text: str) -> range:
    """Read a range of seeds, `A-B` with both ends, or one.

    Raises
    ------
    argparse.ArgumentTypeError
        If it is none.
    """
    found = re.fullmatch(r'(\d+)(?:-(\d+))?', text)
    if not found or int(found[2] or found[1]) < int(found[1]):
        raise argparse.ArgumentTypeError(f'{text!r} are no seeds: give 1-20, or 7')
    return range(int(found[1]), int(found[2] or found[1]) + 1)
