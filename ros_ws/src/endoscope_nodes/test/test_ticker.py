import time

import pytest
from rclpy.context import Context
from rclpy.task import Future
from rosgraph_msgs.msg import Clock

from endoscope_bags.cdr import encode_clock
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import LOCK_STEP
from endoscope_nodes.runtime.runtime import Runtime

MS = 1_000_000


class Beaten(EndoscopeNode):
    def __init__(self, runtime):
        super().__init__('beaten', runtime)
        self.beats = []
        self.slow = []
        self.fast = []
        self.ticker.add(lambda stamp, periods: self.beats.append((stamp, periods)))
        self.ticker.every(0.05, lambda: self.slow.append(self.ticker.now_ns()))
        self.ticker.every(0.01, lambda: self.fast.append(self.ticker.now_ns()))


@pytest.fixture
def simulated():
    with Runtime(['--ros-args', '-p', 'use_sim_time:=true'], Context(), 229) as runtime:
        node = runtime.add(Beaten)
        clock = node.create_publisher(Clock, '/clock', LOCK_STEP)

        def beat(*stamps_ms):
            for stamp in stamps_ms:
                clock.publish(encode_clock(stamp * MS))
            future = Future()
            timer = node.create_timer(
                0.01, lambda: future.done() or future.set_result(None), clock=node.ticker._steady
            )
            runtime.spin_until(future, 10.0)
            node.destroy_timer(timer)

        while not clock.get_subscription_count():
            time.sleep(0.01)
        yield node, beat


def test_each_clock_message_is_a_beat(simulated):
    node, beat = simulated
    assert node.ticker.now_ns() == 0
    beat(5, 6, 7)
    assert node.beats == [(5 * MS, 1), (6 * MS, 1), (7 * MS, 1)]
    assert node.ticker.now_ns() == node.ticker.monotonic_ns() == 7 * MS
    assert node.get_clock().now().nanoseconds == 7 * MS


def test_missing_and_repeated_messages_are_accounted_for(simulated):
    node, beat = simulated
    beat(5, 6, 6, 9)
    assert node.beats == [(5 * MS, 1), (6 * MS, 1), (9 * MS, 3)]
    assert (node.ticker.ticks, node.ticker.missed) == (3, 2)


def test_time_may_begin_anew(simulated):
    node, beat = simulated
    beat(500, 501)
    beat(3, 4)
    assert node.beats[-2:] == [(3 * MS, 1), (4 * MS, 1)]


def test_slow_callbacks_follow_simulated_time(simulated):
    node, beat = simulated
    for start in range(1, 201, 40):
        beat(*range(start, start + 40))
    assert len(node.slow) in (4, 5)


def test_real_time_accounts_for_every_millisecond():
    with Runtime(['--ros-args'], Context(), 229) as runtime:
        node = runtime.add(Beaten)
        runtime.spin_until(Future(), 0.3)
        runtime.ticker.forget((node,))
        stamps = [stamp for stamp, _ in node.beats]
        assert len(node.beats) > 3
        for (before, _), (stamp, periods) in zip(node.beats, node.beats[1:], strict=False):
            assert stamp - before == periods * MS
        assert node.ticker.ticks + node.ticker.missed == sum(p for _, p in node.beats)
        assert abs(stamps[-1] - time.time_ns()) < 5_000 * MS


def test_a_stall_is_one_beat_with_the_time_that_passed_and_no_burst():
    with Runtime(['--ros-args'], Context(), 229) as runtime:
        node = runtime.add(Beaten)
        done, slow_before = Future(), []

        def stall(stamp, _):
            if len(node.beats) == 50:
                slow_before.extend((len(node.fast), len(node.slow)))
                time.sleep(0.2)
            if len(node.beats) > 51 and stamp > node.beats[50][0] + 100 * MS and not done.done():
                done.set_result(None)

        runtime.ticker.add(stall)
        assert runtime.spin_until(done, 30.0)
    (before, _), (first, periods) = node.beats[49:51]
    assert periods >= 199
    assert first - before == periods * MS
    after = [count for stamp, count in node.beats[51:] if stamp <= first + 50 * MS]
    assert min(after) >= 1
    assert sum(after) <= 50
    for calls, number, period in zip((node.fast, node.slow), slow_before, (10, 50), strict=True):
        since = [call for call in calls[number:] if call <= first + 50 * MS]
        assert len(since) <= 2 + 50 // period


def test_a_rate_that_does_not_divide_is_refused():
    runtime = Runtime(['--ros-args', '-p', 'tick_rate:=300'], Context(), 229)
    try:
        with pytest.raises(ParameterError, match='divides 1000'):
            runtime.add(Beaten)
    finally:
        runtime.close()
