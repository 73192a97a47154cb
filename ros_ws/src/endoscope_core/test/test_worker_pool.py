"""Workers end with what they were started for."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from endoscope_core.workers import worker_pool

PROGRAM = """
import os
import signal
import sys
import time
from pathlib import Path
from endoscope_core.workers import worker_pool


def linger(folder):
    Path(folder, str(os.getpid())).touch()
    time.sleep(600)


def unwind(signum, frame):
    raise SystemExit(143)


if __name__ == '__main__':
    signal.signal(signal.SIGTERM, unwind)  # as the command line does it
    with worker_pool(2) as pool:
        futures = [pool.submit(linger, sys.argv[1]) for _ in range(50)]
        futures[0].result()
"""


def _alive(pid: int) -> bool:
    try:
        state = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0]
    except FileNotFoundError:
        return False
    return state != 'Z'


def _until(condition, what):
    end = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.02)


@pytest.mark.skipif(sys.platform != 'linux', reason='reads /proc')
@pytest.mark.parametrize(
    ('number', 'status'), [(signal.SIGTERM, 143), (signal.SIGKILL, -signal.SIGKILL)]
)
def test_no_worker_outlives_the_process_that_started_it(tmp_path, number, status):
    program = tmp_path / 'program.py'
    program.write_text(PROGRAM)
    begun = tmp_path / 'begun'
    begun.mkdir()
    starter = subprocess.Popen([sys.executable, program, begun], stderr=subprocess.PIPE)
    try:
        _until(lambda: len(list(begun.iterdir())) == 2, 'two workers have begun')
        workers = [int(path.name) for path in begun.iterdir()]
        assert all(map(_alive, workers))
        starter.send_signal(number)
        starter.communicate(timeout=60)
    finally:
        starter.kill()
    assert starter.returncode == status
    _until(lambda: not any(map(_alive, workers)), 'the workers have ended')
    assert len(list(begun.iterdir())) == 2, 'a task was begun after the end'


def test_an_error_gives_up_what_is_not_done():
    with pytest.raises(ZeroDivisionError), worker_pool(1) as pool:
        endless = pool.submit(time.sleep, 600)
        _until(endless.running, 'the task has begun')
        raise ZeroDivisionError
    assert endless.done()
