"""The plugin that knows what a test file may cost."""

import json
import os
import subprocess
import sys
from pathlib import Path

COSTLY = """
import time
import pytest
from run_report import _loop

@pytest.mark.nightly
def test_costly():
    end = time.thread_time() + 0.3 * _loop()
    while time.thread_time() < end:
        pass
"""
BUDGETS = {'test_over.py': 0.1, 'test_within.py': 1.0}


def test_a_file_beyond_its_budget_fails_the_run(tmp_path):
    plugin = Path(__file__).with_name('run_report.py').read_text()
    (tmp_path / 'run_report.py').write_text(plugin.replace('NEGLIGIBLE = 5.0', 'NEGLIGIBLE = 0.0'))
    for name in (*BUDGETS, 'test_new.py'):
        (tmp_path / name).write_text(COSTLY)
    (tmp_path / 'durations.json').write_text(json.dumps(BUDGETS))
    (tmp_path / 'pytest.ini').write_text('[pytest]\nmarkers = nightly\n')
    command = [sys.executable, '-m', 'pytest', '-p', 'run_report', '-q']
    environment = {k: v for k, v in os.environ.items() if k not in ('WRITE_DURATIONS', 'TOO_MUCH')}

    def run(*words):
        return subprocess.run(
            [*command, *words],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )

    assert run('-m', 'nightly', 'test_over.py').returncode == 0, (
        'a budget is what the tests of the day may take'
    )
    done = run()
    assert done.returncode == 6, done.stdout
    over = tmp_path / '.pytest_cache/v/run_report/over_budget'
    assert json.loads(over.read_text()) == ['test_over.py']
    [said] = [line for line in done.stdout.splitlines() if 'over its budget' in line]
    assert said.startswith('over its budget: test_over.py took')
