"""A plugin for pytest: what the tests of each file cost, and what could not be tried here.

`durations.json` beside this file says what each test file may cost: CPU seconds of its tests and of
the programs that they start, over those of 10^7 additions in a Python loop in the same run, so that
a slow machine is no reason, nor is physics that has to be compiled anew. Files that cost most begin
first. A file that takes half more than its budget fails the run, where `make -C ros_ws test` tries
it once more with nothing beside it; `make -C ros_ws durations` writes the budgets anew. What a
browser and its system calls take is in no such proportion (1.5 to 1.9 times as much on another
machine of the same loop), so such tests may take three times as much (`TOO_MUCH`). At night there
are no budgets.
"""

import json
import os
import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

BUDGETS = Path(__file__).with_name('durations.json')
SHOWN = 10
TOO_MUCH = float(os.environ.get('TOO_MUCH', '1.5'))
NEGLIGIBLE = 5.0
"""Costs that are no reason: those of a small file scatter."""
OVER_BUDGET = 6
"""Exit status, which pytest has no meaning for."""
ADDITIONS = 300_000

_mark = 0.0
_begun: set[Path] = set()
_seconds: Counter[str] = Counter()
_cpu: Counter[str] = Counter()
_loops: list[float] = []


def _cpu_now() -> float:
    """CPU seconds of this process and of those that it has waited for, but for compiling."""
    return sum(os.times()[:4]) - _compiling.seconds


class _Compiling:
    """A listener of numba: CPU seconds that it compiles, once it has been imported."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._listens = False
        self._depth = 0
        self._begun = 0.0

    def listen(self) -> None:
        if not self._listens and 'numba' in sys.modules:
            from numba.core import event

            event.Listener.register(_Compiling)
            event.register('numba:compile', self)
            self._listens = True

    def notify(self, told: object) -> None:
        if told.is_start:
            self._begun = self._begun if self._depth else time.thread_time()
            self._depth += 1
        else:
            self._depth -= 1
            self.seconds += 0.0 if self._depth else time.thread_time() - self._begun


_compiling = _Compiling()


def _loop() -> float:
    """CPU seconds of 10^7 additions, by some of them."""
    begun, total = time.thread_time(), 0
    for number in range(ADDITIONS):
        total += number
    return (time.thread_time() - begun) * 1e7 / ADDITIONS


def _budgets() -> dict[str, float]:
    return json.loads(BUDGETS.read_text()) if BUDGETS.exists() else {}


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put files that cost most first, so that none is left for one process at the end."""
    budgets, root = _budgets(), config.rootpath
    first = {item.path: -number for number, item in enumerate(reversed(items))}
    items.sort(
        key=lambda item: (
            -budgets.get(item.path.relative_to(root).as_posix(), 0.0),
            first[item.path],
        )
    )


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Begin to count what a test costs."""
    global _mark
    _compiling.listen()
    _mark = _cpu_now()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Iterator[pytest.TestReport]:
    """Note what a part of a test has cost, and at the first of a file how fast the machine is."""
    global _mark
    report = yield
    now = _cpu_now()
    report.cpu, report.loop = now - _mark, 0.0
    if item.path not in _begun:
        _begun.add(item.path)
        report.loop = _loop()
        now = _cpu_now()
    _mark = now
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Add up, in the process that all reports come to."""
    file = report.nodeid.partition('::')[0]
    _seconds[report.nodeid] += report.duration
    # The report of a process that died has neither.
    _cpu[file] += getattr(report, 'cpu', 0.0)
    if loop := getattr(report, 'loop', 0.0):
        _loops.append(loop)


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail where a file has taken too much, or write what each has taken."""
    if hasattr(session.config, 'workerinput') or not _loops:
        return
    if 'WRITE_DURATIONS' in os.environ:
        root = session.config.rootpath
        costs = {f: c for f, c in {**_budgets(), **_costs()}.items() if (root / f).exists()}
        text = json.dumps(dict(sorted(costs.items())), indent=1)
        BUDGETS.write_text(f'{text}\n')
    elif over := _over_budget(session.config):
        session.config.cache.set('run_report/over_budget', [*over])
        session.exitstatus = session.exitstatus or OVER_BUDGET


def _costs() -> dict[str, float]:
    loop = statistics.median(_loops)
    return {file: round(seconds / loop, 1) for file, seconds in _cpu.items()}


def _over_budget(config: pytest.Config) -> dict[str, tuple[float, float]]:
    if config.option.markexpr == 'nightly':
        return {}
    budgets, costs = _budgets(), _costs()
    return {
        file: (cost, budgets[file])
        for file, cost in costs.items()
        if file in budgets and cost > max(TOO_MUCH * budgets[file], budgets[file] + NEGLIGIBLE)
    }


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the slowest tests, the costliest files, and what was skipped for which reason."""
    write = terminalreporter.write_line
    if len(_seconds) > 1 and _loops:
        terminalreporter.section(f'{SHOWN} slowest tests and costliest files')
        for test, seconds in _seconds.most_common(SHOWN):
            write(f'{seconds:7.1f} s  {test}')
        costs = Counter(_costs())
        for file, cost in costs.most_common(SHOWN):
            write(f'{cost:7.1f} loops of CPU time  {file}')
        write(f'{costs.total():7.1f} in all, {statistics.median(_loops):.2f} s each')
    if 'WRITE_DURATIONS' not in os.environ and _loops:
        for file, (cost, budget) in _over_budget(terminalreporter.config).items():
            write(f'over its budget: {file} took {cost:.1f} loops of CPU time, not {budget:.1f}')
    reasons = Counter(_reason(report) for report in terminalreporter.stats.get('skipped', []))
    if reasons:
        terminalreporter.section('not tried here')
        for reason, count in reasons.most_common():
            write(f'{count} {"test" if count == 1 else "tests"}: {reason}')


def _reason(report: pytest.TestReport | pytest.CollectReport) -> str:
    if isinstance(report.longrepr, tuple):
        return report.longrepr[2].removeprefix('Skipped: ')
    return str(report.longrepr)
