"""The same function on many tasks, side by side on a few threads."""

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, wait
from threading import Thread
from typing import Any

_LOOK_S = 1.0


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
