"""Tasks side by side."""

import os
import signal
import subprocess
import sys
import threading
import time

from endoscope_explain.parallel import parallel_map

BEGINNING = """
import os
import signal
from endoscope_explain.parallel import parallel_map
"""


def printed_by(program):
    """Words that a process of its own prints: beside threads, as tests have, none is forked."""
    done = subprocess.run(
        [sys.executable, '-c', BEGINNING + program],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_results_come_in_the_order_of_the_tasks():
    assert printed_by("""
factor = 3
print(*parallel_map(lambda x: factor * x, [5, 1, 4], 2))
""") == ['15', '3', '12']


def test_tasks_run_in_other_processes():
    """Time and again: what a first pool leaves behind must not keep a second one from forking."""
    parent, *workers = printed_by("""
print(os.getpid())
for _ in range(2):
    print(*parallel_map(lambda _: os.getpid(), range(8), 2))
""")
    assert len(workers) == 16
    assert parent not in workers
    assert not set(workers[:8]) & set(workers[8:])


def test_beside_another_thread_they_run_in_this_process():
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait)
    thread.start()
    try:
        assert parallel_map(lambda _: os.getpid(), [1, 2], 2) == [os.getpid()] * 2
    finally:
        ended.set()
        thread.join()


def test_an_error_in_a_worker_comes_to_the_caller():
    assert printed_by("""
try:
    parallel_map(lambda x: 1 / x, [1, 0], 2)
except ZeroDivisionError:
    print('told')
""") == ['told']


def test_short_tasks_never_leave_a_worker_behind():
    """A worker that starts while the tasks are done already must still end."""
    assert printed_by("""
def unwind(signum, frame):
    raise SystemExit(143)
signal.signal(signal.SIGTERM, unwind)  # as the command line does it
print(all(parallel_map(str, [1, 2], 2) == ['1', '2'] for _ in range(200)))
""") == ['True']


LINGERING = """
import time
from pathlib import Path
def linger(name):
    Path(name).touch()
    time.sleep(600 if name == 'long' else 0)
def unwind(signum, frame):
    raise SystemExit(143)
signal.signal(signal.SIGTERM, unwind)  # as the command line does it
parallel_map(linger, ['long', 'short'], 2)
"""


def test_a_signal_to_all_processes_ends_them(tmp_path):
    """As `timeout` and init systems send it: the workers may die before they are told to."""
    with subprocess.Popen(
        [sys.executable, '-c', BEGINNING + LINGERING], cwd=tmp_path, start_new_session=True
    ) as program:
        try:
            end = time.monotonic() + 60
            while not (tmp_path / 'long').exists() or not (tmp_path / 'short').exists():
                assert time.monotonic() < end, 'both tasks have begun'
                time.sleep(0.02)
            time.sleep(0.2)  # the worker of the short one waits for another
            os.killpg(program.pid, signal.SIGTERM)
            assert program.wait(timeout=60) == 143
        finally:
            program.kill()


def test_a_worker_that_dies_is_an_error_and_no_endless_wait():
    assert printed_by("""
from concurrent.futures.process import BrokenProcessPool
try:
    parallel_map(lambda _: os.kill(os.getpid(), signal.SIGKILL), [1, 2], 2)
except BrokenProcessPool:
    print('told')
""") == ['told']
