"""What every bench does: work side by side, progress, rows of tables, and the machine."""

import os
import platform
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Future, as_completed
from pathlib import Path
from typing import Any

from endoscope_core.errors import EndoscopeError
from endoscope_core.workers import worker_pool


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
    with worker_pool(jobs) as pool:
        futures = {pool.submit(function, *call): call for call in calls}
        for future in as_completed(futures):
            yield futures[future], future


def report(line: str) -> None:
    """Say on stderr how far it has come."""
    print(line, file=sys.stderr, flush=True)


def table_row(*cells: object) -> str:
    return f'| {" | ".join(map(str, cells))} |'


def table_head(*columns: str) -> str:
    """The two lines above the rows of a Markdown table."""
    return f'{table_row(*columns)}\n|{"---|" * len(columns)}'


def today_and_machine() -> str:
    """Date, cores and processor, which a table is headed by."""
    processor = platform.processor() or platform.machine()
    return f'{time.strftime("%Y-%m-%d")}, {os.cpu_count()} cores, {processor}'


def cpu_seconds(pid: int) -> float:
    """User and system time in s that a running process has used so far (Linux ``/proc``)."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
