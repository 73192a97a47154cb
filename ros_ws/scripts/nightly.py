"""Runs what takes too long, or needs too much, for every change; writes how it ended to a page."""

import datetime
import subprocess
import sys
import time
from pathlib import Path

from endoscope_lab.commands import BENCHES

WORKSPACE = Path(__file__).parents[1]
ENDOSCOPE = Path(sys.executable).with_name('endoscope')
ONCE = ('--seeds', '--seed', '--repetitions', '--sound', '--nominal')
"""Options with which a bench is tried once."""
PAGE = """# Nightly run

`make -C ros_ws nightly` runs what takes too long, or needs too much, for every change: faults in
real time, another DDS, Docker files, clients and readers that others wrote, ROS 2 Kilted, PyTorch,
LeRobot, the notebook, and one seed of each bench. Its last result, of {day}:

| what | result | min |
|---|---|---|
{rows}
"""


def main() -> int:
    """Run all of it; 1 if anything failed."""
    runs = {
        'tests marked `nightly`': ('make', 'nightly-test'),
        'ROS 2 Kilted': ('make', 'kilted-test'),
        'PyTorch': ('make', 'train-test'),
    }
    for name, bench in BENCHES.items():
        flags = [flag for flag, _ in bench.options]
        # Where recordings are asked for there is nothing to try it on.
        if all(flag.startswith('-') for flag in flags):
            once = [word for flag in flags if flag in ONCE for word in (flag, '1')]
            runs[f'`endoscope bench {name}`'] = (str(ENDOSCOPE), 'bench', name, *once)
    rows, failed = [], False
    for what, command in runs.items():
        print(f'== {what}: {" ".join(command)}', flush=True)
        begun = time.monotonic()
        status = subprocess.run(command, cwd=WORKSPACE, check=False).returncode
        failed |= status != 0
        result = 'passed' if status == 0 else f'failed, exit {status}'
        rows.append(f'| {what} | {result} | {(time.monotonic() - begun) / 60.0:.0f} |')
        print(f'== {what}: {result}', flush=True)
    page = PAGE.format(day=datetime.datetime.now().date().isoformat(), rows='\n'.join(rows))
    (WORKSPACE / 'doc/nightly.md').write_text(page, encoding='utf-8')
    return int(failed)


if __name__ == '__main__':
    sys.exit(main())
