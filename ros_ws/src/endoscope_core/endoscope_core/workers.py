"""Processes and threads side by side, none of which outlives what it was started for."""

import ctypes
import multiprocessing
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, wait
from contextlib import contextmanager
from threading import Thread
from typing import Any

_PR_SET_PDEATHSIG = 1
_LOOK_S = 1.0


@contextmanager
def worker_pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Fresh processes that end with the block or with the process that started them.

    An executor of its own, left by an error or a signal, would first do every task that was
    submitted, and workers of a killed process would go on with theirs, each for minutes. Left
    without an error, this one waits for its tasks; otherwise they are given up.
    """
    before = set(multiprocessing.active_children())
    context = multiprocessing.get_context('spawn')
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_follow_parent)
    try:
        yield pool
    except BaseException:
        for worker in set(multiprocessing.active_children()) - before:
            worker.terminate()
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()


def _follow_parent() -> None:
    """Leave what Ctrl-C means to the parent, and end when it ends: prctl(2)."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if sys.platform == 'linux':
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


def parallel_map[Task, Result](
    function: Callable[[Task], Result], tasks: Sequence[Task], jobs: int
) -> list[Result]:
    """Results of `function` on every task, in order, by threads; raises what the first raised."""
    # Threads are enough, as the compiled physics and linear algebra, where the time goes, let
    # others run meanwhile; and closures over large recordings need not travel to other processes.
    if jobs <= 1 or len(tasks) <= 1:
        return [function(task) for task in tasks]
    waiting = deque((Future[Result](), task) for task in tasks)
    futures = [future for future, _ in waiting]
    for _ in range(min(jobs, len(tasks))):
        # An executor's threads would keep an interrupted program until their tasks are done.
        Thread(target=_work, args=(function, waiting), daemon=True).start()
    try:
        return [_awaited(future) for future in futures]
    finally:
        # Tasks that were not begun are given up where one has raised.
        waiting.clear()


def _awaited[Result](future: Future[Result]) -> Result:
    # A signal that comes just as a wait begins is acted upon only once the wait is over.
    while wait([future], _LOOK_S).not_done:
        pass
    return future.result()


def _work(function: Callable[[Any], Any], waiting: deque[tuple[Future[Any], Any]]) -> None:
    while True:
        try:
            future, task = waiting.popleft()
        except IndexError:
            return
        try:
            future.set_result(function(task))
        except BaseException as error:  # noqa: BLE001 it is the caller's
            future.set_exception(error)
