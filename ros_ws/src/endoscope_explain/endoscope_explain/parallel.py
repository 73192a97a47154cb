"""The same function on many tasks, side by side on a few processes."""

import threading
from collections.abc import Callable, Sequence
from typing import Any

from endoscope_core.worker_pool import worker_pool

_function: Callable[[Any], Any] | None = None


def parallel_map[Task, Result](
    function: Callable[[Task], Result], tasks: Sequence[Task], jobs: int
) -> list[Result]:
    """Results of `function` on every task, in order.

    Workers are forked, so that the function may be a closure over large arrays, which are not
    copied. A process with other threads alive cannot be forked safely; there the tasks run one
    after the other.

    Parameters
    ----------
    function : callable
        Its result must be picklable.
    tasks : sequence
    jobs : int
        Number of processes.

    Returns
    -------
    list
    """
    global _function
    if jobs <= 1 or len(tasks) <= 1 or threading.active_count() > 1:
        return [function(task) for task in tasks]
    _function = function
    try:
        with worker_pool(min(jobs, len(tasks)), 'fork') as pool:
            return list(pool.map(_call, tasks))
    finally:
        _function = None


def _call(task: Any) -> Any:
    if _function is None:
        raise RuntimeError('a worker was started without a function')
    return _function(task)
