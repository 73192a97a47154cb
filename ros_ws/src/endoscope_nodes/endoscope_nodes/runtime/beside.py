"""Computing beside the beat of a node."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from endoscope_core.errors import EndoscopeError
from endoscope_nodes.runtime.ticker import Ticker


class Beside:
    """Computes in a thread; in simulated time that nobody paces at once, so that it is the same."""

    def __init__(self, ticker: Ticker) -> None:
        self._ticker = ticker
        self._thread = ThreadPoolExecutor(1)

    def submit[**P, T](
        self, compute: Callable[P, T], *args: P.args, **kwargs: P.kwargs
    ) -> Future[T]:
        if self._ticker.paced or not self._ticker.simulated:
            return self._thread.submit(compute, *args, **kwargs)
        done: Future[T] = Future()
        try:
            done.set_result(compute(*args, **kwargs))
        except EndoscopeError as error:
            done.set_exception(error)
        return done

    def close(self) -> None:
        self._thread.shutdown()
