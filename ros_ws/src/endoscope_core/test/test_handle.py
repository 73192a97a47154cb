import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from endoscope_core.control import Handle, HandleRefusal
from endoscope_core.control.limits import COUNT, Play, SmoothFollower

MS = 1_000_000
RATES = (50, 250, 1000)
CLOCK = 7 * 10**18


def handle(scale=1.0, reach=1.5):
    return Handle((-reach, -reach), (reach, reach), scale)


def played(hand, rate, angle_at, seconds, engaged_at=0.2, jitter=0.0, seed=0):
    """Positions and velocities (N, J) at 1 kHz of a handle at `rate` Hz, and their times."""
    generator = np.random.default_rng(seed)
    step = 1e9 / rate
    late = generator.uniform(0.0, jitter * step, round(seconds * rate) + 1)
    due = [(round(k * step), round(k * step + late[k]) + 100) for k in range(late.size)]
    times, positions, velocities = [], [], []
    for tick in range(1, round(seconds * 1000)):
        now = tick * MS
        while due and due[0][1] <= now:
            taken, received = due.pop(0)
            assert hand.take(CLOCK + taken, angle_at(taken * 1e-9), received) is None
        if now >= engaged_at * 1e9 and not hand.engaged:
            hand.engage((0.0, 0.0))
        answer = hand.follow(now)
        if answer is not None:
            times.append(now * 1e-9)
            positions.append(answer[0])
            velocities.append(answer[1])
    return np.array(times), np.array(positions), np.array(velocities)


@pytest.mark.parametrize('rate', RATES)
@pytest.mark.parametrize('jitter', [0.0, 0.5])
def test_a_steady_motion_comes_out_steady_at_every_rate(rate, jitter):
    hand = handle()
    time, position, velocity = played(hand, rate, lambda t: (0.5 * t, -0.5 * t), 2.0, jitter=jitter)
    settled = time > 0.8
    assert np.max(np.abs(velocity[settled] - (0.5, -0.5))) < (0.005 if jitter == 0.0 else 0.25)
    assert np.max(np.abs(np.diff(position, axis=0))) < 1.5 * 0.5e-3
    assert np.all(np.diff(position[settled][:, 0]) > 0.0)


@pytest.mark.parametrize('scale', [1.0, 0.5])
def test_the_velocity_is_that_of_the_position(scale):
    time, position, velocity = played(
        handle(scale), 100, lambda t: (0.5 * math.sin(5.0 * t), 0.2 * math.cos(9.0 * t)), 2.0
    )
    difference = np.gradient(position, time, axis=0)
    assert np.max(np.abs(difference - velocity)[2:-2]) < 0.03


def test_engaging_begins_at_the_measured_pose_whatever_the_handle_did_before():
    hand = handle(0.5)
    for k in range(400):
        hand.take(k * MS + 1, (0.002 * k, 0.0), k * MS)
        hand.follow(k * MS)
    hand.engage((0.7, -0.2))
    for k in range(400, 1000):
        hand.take(k * MS + 1, (0.8 + 0.0005 * (k - 400), 0.0), k * MS)
        position, _ = hand.follow(k * MS)
        if k == 400:
            assert position == pytest.approx((0.7, -0.2), abs=2e-3)
    # What the hand did within the lag before engagement is followed, too.
    assert position[0] == pytest.approx(
        0.7 + 0.5 * (0.2995 + 2.0 * hand.lag - 0.5 * hand.lag), abs=2e-3
    )
    hand.release()
    assert hand.follow(1000 * MS) is None
    hand.engage((0.1, 0.1))
    assert hand.follow(1001 * MS)[0] == pytest.approx((0.1, 0.1), abs=1e-3)


def test_silence_releases_and_nothing_is_extrapolated():
    hand = handle()
    for k in range(300):
        hand.take(k * MS + 1, (0.001 * k, 0.0), k * MS)
        hand.follow(k * MS)
        if k == 100:
            hand.engage((0.0, 0.0))
    late = [hand.follow(k * MS) for k in range(300, 399)]
    assert all(answer is not None for answer in late)
    assert max(answer[0][0] for answer in late) <= 0.199 + 1.0 * hand.lag
    assert abs(late[-1][1][0]) < 0.05
    assert hand.follow(400 * MS) is None
    assert not hand.engaged
    assert hand.take(401 * MS, (1.2, 0.0), 401 * MS) is None
    assert hand.follow(401 * MS) is None


@pytest.mark.parametrize(
    ('stamp', 'position', 'reason'),
    [
        (100 * MS, (math.nan, 0.0), HandleRefusal.NOT_FINITE),
        (100 * MS, (0.0,), HandleRefusal.MALFORMED),
        (99 * MS, (0.0, 0.0), HandleRefusal.STAMP),
        (100 * MS, (0.0, 0.5), HandleRefusal.JUMP),
    ],
)
def test_each_reason_is_refused_counted_and_changes_nothing(stamp, position, reason):
    hand = handle()
    for k in range(100):
        assert hand.take(k * MS, (0.0, 0.0), k * MS) is None
    assert hand.take(stamp, position, 100 * MS) is reason
    assert hand.refused[reason] == 1
    assert str(reason) in hand.last_reason
    assert hand.take(100 * MS, (0.0, 0.0), 100 * MS) is None


def test_a_stamp_that_lies_moves_a_sample_by_no_more_than_the_jitter():
    hand = handle()
    for k in range(100):
        hand.take(k * MS, (0.0, 0.0), k * MS)
    # A year ahead: neither is a jump allowed nor the next sample late.
    assert hand.take(3 * 10**16, (0.2, 0.0), 100 * MS) is HandleRefusal.JUMP
    assert hand.take(3 * 10**16, (0.01, 0.0), 100 * MS) is None
    assert hand.take(3 * 10**16 + MS, (0.011, 0.0), 101 * MS) is None
    assert hand.interval == pytest.approx(1e-3)


def test_engaging_a_handle_that_was_never_heard_is_refused():
    with pytest.raises(RuntimeError, match='not been heard'):
        handle().engage((0.0, 0.0))


@given(st.integers(1, 6), st.floats(0.05, 5.0), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
@settings(max_examples=15, deadline=None)
def test_engaging_anew_moves_by_the_scaled_way_each_time_and_comes_back_from_an_end_at_once(
    engagements, scale, way, back
):
    """As with a mouse that is lifted: what the hand does while released moves nothing."""
    hand, now, slave = handle(scale), 0, 0.0

    def turn(start, end):
        """Turn the handle within 0.4 s, and rest until the smoothing has settled."""
        nonlocal now
        answer = None
        for k in range(1200):
            now += MS
            share = min(1.0, k / 400)
            assert hand.take(now, (start + share * (end - start), 0.0), now) is None
            answer = hand.follow(now)
        return None if answer is None else answer[0][0]

    turn(0.0, 0.0)
    for _ in range(engagements):
        hand.engage((slave, 0.0))
        expected = min(1.5, max(-1.5, slave + scale * way))
        slave = turn(0.0, way)
        assert slave == pytest.approx(expected, abs=scale * 2.0 * COUNT + 1e-6)
        hand.release()
        assert turn(way, 0.0) is None
    end = math.copysign(1.5, way)
    hand.engage((end, 0.0))
    assert turn(0.0, way) == end
    hand.engage((end, 0.0))
    inward = -math.copysign(abs(back), way)
    expected = end + scale * inward
    if -1.5 <= expected <= 1.5:
        assert turn(way, way + inward) == pytest.approx(expected, abs=scale * 2.0 * COUNT + 1e-6)


@pytest.mark.parametrize('scale', [math.nan, math.inf, 0.0, -1.0])
def test_a_scale_that_is_no_positive_number_is_refused(scale):
    with pytest.raises(ValueError, match=r'scale = .* must be positive and finite'):
        handle(scale)
    hand = handle()
    with pytest.raises(ValueError, match='scale = '):
        hand.scale = scale
    assert hand.scale == 1.0


numbers = st.floats(allow_nan=True, allow_infinity=True)


@given(
    st.lists(
        st.tuples(st.integers(-(10**18), 10**18), numbers, st.integers(0, 200 * MS)), max_size=40
    )
)
def test_whatever_comes_the_slave_stays_within_its_limits(samples):
    hand = handle()
    now = 0
    for stamp, angle, wait in samples:
        now += wait
        hand.take(stamp, (angle, 0.0), now)
        if not hand.engaged and hand.alive(now):
            hand.engage((0.5, 0.5))
        answer = hand.follow(now)
        if answer is not None:
            assert all(-1.5 <= x <= 1.5 for x in answer[0])
            assert all(math.isfinite(v) for v in answer[1])


@given(st.floats(0.1, 300.0), st.lists(st.floats(1e-4, 0.05), min_size=1, max_size=50))
def test_a_motion_one_way_is_smoothed_to_a_motion_one_way(bandwidth, periods):
    smooth = SmoothFollower(bandwidth, 0.0)
    value = before = 0.0
    for k, dt in enumerate(periods):
        value += 0.1 * (k % 3)
        smooth.follow(value, dt)
        assert before - 1e-12 <= smooth.position <= value + 1e-12
        assert smooth.velocity >= -1e-9
        before = smooth.position


@given(st.lists(st.floats(-3.0, 3.0), max_size=50))
def test_play_stays_within_half_its_width(values):
    play = Play(0.2, 0.0)
    for value in values:
        before = play.value
        after = play.follow(value)
        assert abs(after - value) <= 0.2 + 1e-12
        assert after == before or abs(after - value) == pytest.approx(0.2)
