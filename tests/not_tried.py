"""A plugin for pytest: what a run could not try on this machine, and why."""

from collections import Counter

import pytest


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print how many tests were skipped for each reason, the commonest first."""
    reasons = Counter(_reason(report) for report in terminalreporter.stats.get('skipped', []))
    if not reasons:
        return
    terminalreporter.section('not tried here')
    for reason, count in reasons.most_common():
        terminalreporter.write_line(f'{count} {"test" if count == 1 else "tests"}: {reason}')


def _reason(report: pytest.TestReport | pytest.CollectReport) -> str:
    if isinstance(report.longrepr, tuple):
        return report.longrepr[2].removeprefix('Skipped: ')
    return str(report.longrepr)
