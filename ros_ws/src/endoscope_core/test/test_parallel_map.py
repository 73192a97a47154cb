"""Tasks side by side."""

import subprocess
import sys
import threading

import pytest

from endoscope_core.workers import parallel_map


def test_results_come_in_the_order_of_the_tasks():
    """The first waits for the last, which no single thread would ever come to."""
    ended = threading.Event()

    def answer(task):
        if task == 5:
            assert ended.wait(60.0)
        if task == 4:
            ended.set()
        return 3 * task

    assert parallel_map(answer, [5, 1, 4], 2) == [15, 3, 12]


def test_alone_or_one_job_stays_on_this_thread():
    def here(_):
        return threading.get_ident()

    assert parallel_map(here, [1, 2], 1) == [threading.get_ident()] * 2
    assert parallel_map(here, [1], 2) == [threading.get_ident()]


def test_there_are_never_more_side_by_side_than_jobs():
    both, third = threading.Barrier(2), []

    def meet(task):
        both.wait(60.0)
        third.append(task)
        return threading.get_ident()

    assert len(set(parallel_map(meet, range(8), 2))) == 2
    assert sorted(third) == list(range(8))


def test_an_error_in_a_task_comes_to_the_caller_and_gives_up_the_rest():
    begun = []

    def divide(task):
        begun.append(task)
        return 1 / task

    with pytest.raises(ZeroDivisionError):
        parallel_map(divide, [0] * 50_000, 2)
    assert len(begun) < 50_000


LINGERING = """
import os
import signal
import threading
from endoscope_core.workers import parallel_map
begun = threading.Barrier(2)
def linger(_):
    if begun.wait() == 0:
        os.write(1, b'begun\\n')  # sys.stdout would still be locked when the interpreter ends
    threading.Event().wait(600)
def unwind(signum, frame):
    raise SystemExit(143)
signal.signal(signal.SIGTERM, unwind)  # as the command line does it
parallel_map(linger, [1, 2], 2)
"""


def test_a_signal_ends_the_program_in_the_midst_of_its_tasks():
    with subprocess.Popen(
        [sys.executable, '-c', LINGERING], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as program:
        try:
            assert program.stdout.readline() == b'begun\n'
            program.terminate()
            assert program.wait(timeout=60) == 143
        finally:
            program.kill()
