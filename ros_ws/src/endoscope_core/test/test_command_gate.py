import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_core.rig import shipped_rig
from endoscope_core.safety import BendingRange, CommandGate, CommandLimits, Refusal, keep_within

MS = 1_000_000
LIMITS = CommandLimits(1.0, max_speed=10.0, max_step=0.2)
HERE = (0.0, 0.0)


def gate_after(commands=1):
    gate = CommandGate(LIMITS)
    for k in range(1, commands + 1):
        assert gate.check(k * MS, HERE, 500 * MS + k * MS, HERE) is None
    return gate


def test_a_regular_stream_is_obeyed():
    gate = CommandGate(LIMITS)
    for k in range(1, 1001):
        position = 0.5 * math.sin(0.001 * k)
        received = k * MS + (k % 7) * MS
        assert gate.check(k * MS, (position, 0.0), received, HERE, (0.5, 0.0)) is None
    assert gate.accepted == 1000
    assert sum(gate.refused.values()) == 0


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        ({'position': (math.nan, 0.0)}, Refusal.NOT_FINITE),
        ({'position': (0.0, math.inf)}, Refusal.NOT_FINITE),
        ({'velocity': (0.0, math.nan)}, Refusal.NOT_FINITE),
        ({'position': (0.0,)}, Refusal.MALFORMED),
        ({'stamp_ns': 2 * MS}, Refusal.STAMP),
        ({'stamp_ns': 0}, Refusal.STAMP),
        ({'stamp_ns': 105 * MS}, Refusal.FUTURE),
        ({'stamp_ns': 10**18}, Refusal.FUTURE),
        ({'position': (1.5, 0.0)}, Refusal.RANGE),
        ({'position': (0.5, 0.0)}, Refusal.RATE),
        ({'received_ns': 500 * MS + 110 * MS}, Refusal.LATE),
    ],
)
def test_each_reason_is_refused_counted_and_leaves_the_stream_as_it_was(change, reason):
    gate = gate_after(2)
    command = {
        'stamp_ns': 3 * MS,
        'position': (0.001, 0.0),
        'velocity': (0.0, 0.0),
        'received_ns': 503 * MS,
        'measured': HERE,
    }
    assert gate.check(**(command | change)) is reason
    assert gate.refused[reason] == 1
    assert gate.accepted == 2
    assert str(reason) in gate.last_reason
    assert gate.check(**command) is None


def test_the_senders_clock_may_be_anything():
    for offset in (-(10**18), 0, 10**15):
        gate = CommandGate(LIMITS)
        for k in range(1, 200):
            assert gate.check(10**18 + k * MS, HERE, 10**18 + offset + k * MS, HERE) is None


def test_a_slowly_drifting_clock_is_not_lateness():
    gate = CommandGate(LIMITS)
    for k in range(1, 300_001, 50):
        drifted = k * MS + (k * MS) // 2000
        assert gate.check(k * MS, HERE, drifted, HERE) is None


def test_a_stream_that_is_late_stays_late_however_often_it_is_refused():
    gate = gate_after(100)
    for k in range(101, 60_001):
        assert gate.check(k * MS, HERE, 1500 * MS + k * MS, HERE) is Refusal.LATE
    assert gate.check(60_001 * MS, HERE, 500 * MS + 60_001 * MS, HERE) is None


def test_a_first_command_from_the_future_does_not_lock_the_others_out():
    gate = CommandGate(LIMITS)
    assert gate.check(10**18, HERE, MS, HERE) is None
    for k in range(2, 100):
        assert gate.check(k * MS, HERE, k * MS, HERE) is None
    assert gate.check(10**18, HERE, 100 * MS, HERE) is Refusal.FUTURE


def test_from_beyond_the_reach_there_is_a_way_back_only():
    gate = CommandGate(LIMITS)
    beyond = (1.3, 0.0)
    assert gate.check(MS, beyond, MS, beyond) is None
    assert gate.check(2 * MS, (1.301, 0.0), 2 * MS, beyond) is Refusal.RANGE
    assert gate.check(3 * MS, (1.299, 0.0), 3 * MS, beyond) is None


@pytest.mark.parametrize('side', [1.0, -1.0])
def test_the_first_command_of_a_stream_leads_no_further_beyond_the_reach(side):
    gate = CommandGate(LIMITS)
    measured = (side * 1.05, 0.0)
    for k, angle in enumerate((1.15, 1.051)):
        assert gate.check((k + 1) * MS, (side * angle, 0.0), MS, measured) is Refusal.RANGE
    assert gate.check(3 * MS, (side * 1.05, 0.0), 3 * MS, measured) is None
    inside = CommandGate(LIMITS)
    assert inside.check(MS, (side * 1.01, 0.0), MS, (side * 0.99, 0.0)) is Refusal.RANGE


def test_a_stream_that_begins_where_the_rig_says_is_obeyed_though_the_pose_is_measured_again():
    facts = shipped_rig().joints
    limits = CommandLimits(facts.reach, facts.speed, facts.entry_step)
    for bent in (0.3, facts.reach - 0.01, facts.reach + 0.01, facts.reach + 1.0):
        for noise in (-0.02, 0.0, 0.02):
            start = facts.entry((bent, -bent))
            again = (bent + noise, -bent - noise)
            assert CommandGate(limits).check(MS, start, MS, again) is None
            assert np.all(np.abs(start) <= bent)


def test_after_a_pause_a_stream_begins_anew_at_the_measured_position():
    gate = gate_after()
    assert gate.is_fresh(501 * MS + 100 * MS)
    assert not gate.is_fresh(501 * MS + 101 * MS)
    assert gate.check(1000 * MS, HERE, 1500 * MS, (0.5, 0.0)) is Refusal.STEP
    assert gate.check(1001 * MS, (0.31, 0.0), 1501 * MS, (0.5, 0.0)) is None


@pytest.mark.parametrize('pause_s', [1, 50, 99, 101, 120, 300, 3600])
@pytest.mark.parametrize('drift', [-5e-4, 0.0, 5e-4])
def test_after_any_pause_a_stream_is_obeyed_whatever_the_clocks_did_meanwhile(pause_s, drift):
    gate = gate_after(500)
    for k in range(1, 5001):
        sent = round((pause_s + 0.5) * 1e9) + k * MS
        stamp = sent + round(drift * pause_s * 1e9)
        assert gate.check(stamp, HERE, 500 * MS + sent, HERE) is None
    assert not gate.unheeded


def test_a_machine_that_slept_goes_on():
    """While it sleeps the clock of the stamps goes on and the monotonic one stands."""
    gate = gate_after(500)
    for k in range(1, 500):
        assert gate.check(600_000 * MS + k * MS, HERE, 1200 * MS + k * MS, HERE) is None


def test_a_late_command_after_a_pause_is_refused_and_said_within_a_third_of_a_second():
    gate = gate_after(500)
    for k in range(501, 802):
        assert not gate.unheeded
        assert gate.check(k * MS, HERE, 3500 * MS + k * MS, HERE) is Refusal.LATE
    assert gate.unheeded.startswith('301 of the last 301 commands are refused, last: late')
    gate.reset()
    assert not gate.unheeded


def test_a_stream_is_unheeded_while_more_is_refused_than_obeyed():
    gate = gate_after(100)
    for k in range(101, 1101):
        wanted = (0.0, 0.0) if k % 3 else (math.nan, 0.0)
        gate.check(k * MS, wanted, 500 * MS + k * MS, HERE)
        assert not gate.unheeded
    for k in range(1101, 3000):
        gate.check(k * MS, HERE if k % 3 == 0 else (math.nan, 0.0), (500 + k) * MS, HERE)
        if gate.unheeded:
            break
    # Of the last second half is refused half a second later; 0.3 s of that are waited for.
    assert 1101 + 750 <= k <= 1101 + 850


def test_one_refused_command_is_no_unheeded_stream():
    gate = CommandGate(LIMITS)
    for k in range(20):
        assert gate.check(k * 300 * MS + 1, (0.21, 0.0), k * 300 * MS, HERE) is Refusal.STEP
        assert not gate.unheeded


def test_an_allowance_is_spent_once():
    """Travel is bounded by the time that went by here, whatever the stamps say."""
    gate = gate_after(2)
    way, last = 0.0, 0.0
    for k in range(3, 100):
        wanted = 0.05 - last
        if gate.check(20 * k * MS, (wanted, 0.0), (500 + k) * MS, HERE) is None:
            way, last = way + abs(wanted - last), wanted
    assert way <= 10.0 * (0.097 + 0.02)


def test_a_stream_at_rest_saves_nothing_up_for_a_leap():
    gate = gate_after(1000)
    assert gate.check(1001 * MS, (0.5, 0.0), 1501 * MS, HERE) is Refusal.RATE


def test_where_an_angle_is_cut_its_velocity_is_zero():
    ranges = [BendingRange(-0.2, 0.3)] * 2
    assert keep_within(ranges, (0.4, 0.1), (1.0, 1.0)) == ((0.3, 0.1), (0.0, 1.0))


def test_reset_forgets_the_stream_but_not_the_counts():
    gate = gate_after(5)
    gate.refuse(Refusal.CLUTCH)
    gate.reset()
    assert not gate.is_fresh(505 * MS)
    assert gate.check(MS, HERE, 0, HERE) is None
    assert gate.accepted == 6
    assert gate.refused[Refusal.CLUTCH] == 1


def test_commands_lost_on_the_way_are_told_from_a_sender_that_jitters():
    gate = CommandGate(LIMITS)
    stamps = [4 * k + 3 * (k % 7 == 0) for k in range(1000)]
    for stamp in stamps:
        assert gate.check((stamp + 1) * MS, HERE, stamp * MS, HERE) is None
    assert 0.97 < gate.accepted / gate.due <= 1.01
    gate = CommandGate(LIMITS)
    for stamp in range(1, 5000):
        if hash((stamp, 7)) % 10 == 7:
            assert gate.check(stamp * MS, HERE, stamp * MS, HERE) is None
    assert gate.accepted / gate.due < 0.5


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
    for stamp, x, y, v, received in stream:
        if gate.check(stamp, (x, y), received, HERE, (v, 0.0)) is None:
            assert all(-1.0 <= p <= 1.0 for p in (x, y))
            assert math.isfinite(v)
    assert gate.accepted + sum(gate.refused.values()) == len(stream)
