"""Tasks side by side."""

import signal

import pytest

from endoscope_explain.parallel import parallel_map


@pytest.fixture
def unwinding_on_sigterm():
    """As the command line does it."""

    def unwind(signum, frame):
        raise SystemExit(143)

    previous = signal.signal(signal.SIGTERM, unwind)
    yield
    signal.signal(signal.SIGTERM, previous)


def test_results_come_in_the_order_of_the_tasks():
    factor = 3
    assert parallel_map(lambda x: factor * x, [5, 1, 4], 2) == [15, 3, 12]


def test_an_error_in_a_worker_comes_to_the_caller():
    with pytest.raises(ZeroDivisionError):
        parallel_map(lambda x: 1 / x, [1, 0], 2)


@pytest.mark.timeout(60)
def test_short_tasks_never_leave_a_worker_behind(unwinding_on_sigterm):
    """A worker that starts while the tasks are done already must still end."""
    for _ in range(200):
        assert parallel_map(str, [1, 2], 2) == ['1', '2']
