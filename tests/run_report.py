"""A plugin for pytest: where the time of a run went, and what it could not try on this machine."""

import re
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

SLOWEST = 10
# A file is of the first kind whose shared modules it imports.
KINDS = {
    'browser': 'browsed_console|chromium',
    'graph in simulated time': 'commanded_graph|simulated_graph',
    'real time': (
        'aurora_rig|console_rig|doc_pages|load_cell_rig|operated_graph|private_domain'
        '|recorded_session|sensor_graph'
    ),
}
UNIT = 'unit'


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    """Print the slowest tests, the seconds of each kind, and what was skipped for which reason."""
    seconds: Counter[tuple[str, str]] = Counter()
    for report in (one for those in terminalreporter.stats.values() for one in those):
        if isinstance(report, pytest.TestReport):
            seconds[report.location[0], report.location[2]] += report.duration
    if len(seconds) > 1:
        terminalreporter.section(f'slowest {SLOWEST} tests, and seconds by kind')
        for (file, test), duration in seconds.most_common(SLOWEST):
            terminalreporter.write_line(f'{duration:7.1f} s  {file}::{test}')
        kinds: Counter[str] = Counter()
        for (file, _), duration in seconds.items():
            kinds[_kind(config.rootpath / file)] += duration
        terminalreporter.write_line(
            '; '.join(f'{kind} {duration:.0f} s' for kind, duration in kinds.most_common())
        )
    reasons = Counter(_reason(report) for report in terminalreporter.stats.get('skipped', []))
    if reasons:
        terminalreporter.section('not tried here')
        for reason, count in reasons.most_common():
            terminalreporter.write_line(f'{count} {"test" if count == 1 else "tests"}: {reason}')


@cache
def _kind(file: Path) -> str:
    text = file.read_text(encoding='utf-8')
    for kind, modules in KINDS.items():
        if re.search(rf'^(from|import) ({modules})\b', text, re.MULTILINE):
            return kind
    return UNIT


def _reason(report: pytest.TestReport | pytest.CollectReport) -> str:
    if isinstance(report.longrepr, tuple):
        return report.longrepr[2].removeprefix('Skipped: ')
    return str(report.longrepr)
