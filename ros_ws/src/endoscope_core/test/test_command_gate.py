import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_core.safety import CommandGate, CommandLimits, Refusal

MS = 1_000_000
LIMITS = CommandLimits((-1.0, -1.0), (1.0, 1.0), max_speed=10.0, max_step=0.2)


def gate_after(commands=1):
    gate = CommandGate(LIMITS)
    for k in range(1, commands + 1):
        assert gate.check(k * MS, (0.0, 0.0), (0.0, 0.0), 500 * MS + k * MS) is None
    return gate


def test_a_regular_stream_is_obeyed():
    gate = CommandGate(LIMITS)
    for k in range(1, 1001):
        position = 0.5 * math.sin(0.001 * k)
        assert gate.check(k * MS, (position, 0.0), (0.5, 0.0), k * MS + (k % 7) * MS) is None
    assert gate.accepted == 1000
    assert sum(gate.refused.values()) == 0


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        ({'position': (math.nan, 0.0)}, Refusal.NOT_FINITE),
        ({'position': (0.0, math.inf)}, Refusal.NOT_FINITE),
        ({'velocity': (0.0, math.nan)}, Refusal.NOT_FINITE),
        ({'position': (0.0,)}, Refusal.MALFORMED),
        ({'stamp_ns': 1 * MS}, Refusal.STAMP),
        ({'stamp_ns': 0}, Refusal.STAMP),
        ({'position': (1.5, 0.0)}, Refusal.RANGE),
        ({'position': (0.05, 0.0)}, Refusal.RATE),
        ({'received_ns': 500 * MS + 110 * MS}, Refusal.LATE),
    ],
)
def test_each_reason_is_refused_counted_and_leaves_the_stream_as_it_was(change, reason):
    gate = gate_after()
    command = {
        'stamp_ns': 2 * MS,
        'position': (0.001, 0.0),
        'velocity': (0.0, 0.0),
        'received_ns': 502 * MS,
    }
    assert gate.check(**(command | change)) is reason
    assert gate.refused[reason] == 1
    assert gate.accepted == 1
    assert str(reason) in gate.last_reason
    assert gate.check(**command) is None


def test_the_senders_clock_may_be_anything():
    for offset in (-(10**18), 0, 10**15):
        gate = CommandGate(LIMITS)
        for k in range(1, 200):
            assert gate.check(10**18 + k * MS, (0.0, 0.0), (), 10**18 + offset + k * MS) is None


def test_a_slowly_drifting_clock_is_not_lateness():
    gate = CommandGate(LIMITS)
    for k in range(1, 300_001, 50):
        drifted = k * MS + (k * MS) // 2000
        assert gate.check(k * MS, (0.0, 0.0), (), drifted) is None


def test_a_stream_that_is_late_stays_late_however_often_it_is_refused():
    gate = gate_after(100)
    for k in range(101, 60_001):
        assert gate.check(k * MS, (0.0, 0.0), (), 1500 * MS + k * MS) is Refusal.LATE
    assert gate.check(60_001 * MS, (0.0, 0.0), (), 500 * MS + 60_001 * MS) is None


def test_first_command_must_be_near_the_held_position():
    gate = CommandGate(LIMITS)
    assert gate.check(MS, (0.3, 0.0), (), MS, held=(0.0, 0.0)) is Refusal.STEP
    assert gate.check(2 * MS, (0.1, 0.0), (), 2 * MS, held=(0.0, 0.0)) is None


def test_a_pause_makes_the_stream_stale_and_its_next_command_a_first_one():
    gate = gate_after()
    assert gate.is_fresh(501 * MS + 100 * MS)
    assert not gate.is_fresh(501 * MS + 101 * MS)
    assert gate.check(1000 * MS, (0.15, 0.0), (), 1500 * MS, held=(0.0, 0.0)) is None


def test_a_command_dated_ahead_may_go_no_further_than_its_receipt_allows():
    gate = gate_after()
    assert gate.check(10**6 * MS, (0.9, 0.0), (), 502 * MS) is Refusal.RATE
    assert gate.check(10**6 * MS, (0.2, 0.0), (), 502 * MS) is None


def test_reset_forgets_the_stream_but_not_the_counts():
    gate = gate_after(5)
    gate.refuse(Refusal.NOT_ENABLED)
    gate.reset()
    assert not gate.is_fresh(505 * MS)
    assert gate.check(MS, (0.0, 0.0), (), 0) is None
    assert gate.accepted == 6
    assert gate.refused[Refusal.NOT_ENABLED] == 1


numbers = st.floats(allow_nan=True, allow_infinity=True, width=64)


@given(
    st.lists(
        st.tuples(
            st.integers(-(10**12), 10**12), numbers, numbers, numbers, st.integers(0, 10**12)
        ),
        max_size=30,
    )
)
def test_whatever_comes_nothing_unsafe_is_obeyed(stream):
    gate = CommandGate(LIMITS)
    last = None
    for stamp, x, y, v, received in stream:
        held = (0.0, 0.0)
        if gate.check(stamp, (x, y), (v, 0.0), received, held) is not None:
            continue
        assert all(-1.0 <= p <= 1.0 for p in (x, y))
        assert math.isfinite(v)
        assert last is None or stamp > last
        last = stamp
    assert gate.accepted + sum(gate.refused.values()) == len(stream)


def test_after_a_pause_a_stream_goes_on_near_where_it_was():
    gate = gate_after()
    assert gate.check(1000 * MS, (0.3, 0.0), (), 1500 * MS) is Refusal.STEP
    assert gate.check(1001 * MS, (0.1, 0.0), (), 1501 * MS) is None
    gate.reset()
    assert gate.check(1002 * MS, (0.9, 0.0), (), 1502 * MS) is None
