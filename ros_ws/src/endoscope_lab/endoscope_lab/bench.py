"""Common parts of the benchmarks: parallel work, progress, rows of tables, and the machine."""

import json
import os
import platform
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

from endoscope_core.errors import EndoscopeError
from endoscope_core.workers import worker_pool


def chosen[T](kind: str, names: Sequence[str] | None, known: Mapping[str, T]) -> dict[str, T]:
    """Known items by chosen names, all by default; EndoscopeError for an unknown name."""
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
    """Yield each call with its future, in the order of completion."""
    with worker_pool(jobs) as pool:
        futures = {pool.submit(function, *call): call for call in calls}
        for future in as_completed(futures):
            yield futures[future], future


def report(line: str) -> None:
    """Print a line of progress to stderr."""
    print(line, file=sys.stderr, flush=True)


def kept_rows[R](file: Path, kind: type[R]) -> list[R]:
    """Read rows that `keep_row` wrote; EndoscopeError for a line without the dataclass's fields."""
    rows = []
    for number, line in enumerate(file.read_text(encoding='utf-8').splitlines(), 1):
        try:
            fields = json.loads(line)
            lists = {k: tuple(v) for k, v in fields.items() if isinstance(v, list)}
            rows.append(kind(**{**fields, **lists}))
        except (ValueError, TypeError) as error:
            raise EndoscopeError(f'{file}, line {number}: no row of a case: {error}') from error
    return rows


def rows_so_far[R](file: Path | None, kind: type[R]) -> list[R]:
    """Read the rows that an interrupted bench has stored; none without a file."""
    return kept_rows(file, kind) if file is not None and file.exists() else []


def keep_row(file: Path | None, row: Any) -> None:
    """Append a row, a dataclass, to a file of JSON lines, unless the file is None."""
    if file is None:
        return
    with file.open('a', encoding='utf-8') as lines:
        lines.write(json.dumps(asdict(row)) + '\n')


def table_row(*cells: object) -> str:
    return f'| {" | ".join(map(str, cells))} |'


def table_head(*columns: str) -> str:
    """The two lines above the rows of a Markdown table."""
    return f'{table_row(*columns)}\n|{"---|" * len(columns)}'


def spread(values: Sequence[float]) -> tuple[float, float, float]:
    """Median, 99th percentile and maximum."""
    ordered = sorted(values)
    return ordered[len(ordered) // 2], ordered[len(ordered) * 99 // 100], ordered[-1]


def today_and_machine() -> str:
    """Date, cores and processor, for the heading of a table."""
    processor = platform.processor() or platform.machine()
    return f'{time.strftime("%Y-%m-%d")}, {os.cpu_count()} cores, {processor}'


def cpu_seconds(pid: int) -> float:
    """User and system time in s that a running process has used so far (Linux ``/proc``)."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='ascii').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
