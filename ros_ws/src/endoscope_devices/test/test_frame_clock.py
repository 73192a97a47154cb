import numpy as np
import pytest

from endoscope_devices.em_tracker.aurora_tracker import FrameClock

MS = 1_000_000


def polled(frames, period_ms, rng, poll_ms=9.0):
    """When each frame is asked for first: up to a poll's length after it is there."""
    return [round((k * period_ms + rng.uniform(0.0, poll_ms)) * MS) + 5_000 * MS for k in frames]


def test_stamps_are_spaced_as_the_frames_whatever_the_polls():
    rng = np.random.default_rng(1)
    clock = FrameClock(40.0)
    frames = [100 + k for k in range(400) if k % 7]
    stamps = [clock.stamp(k, at) for k, at in zip(frames, polled(frames, 25.0, rng), strict=True)]
    error = np.array(stamps) / MS - (np.array(frames) * 25.0 + 5_000)
    assert error[50:].max() < 0.5
    assert error[50:].min() >= 0.0
    assert np.diff(stamps).min() > 0


@pytest.mark.parametrize('drift', [1 + 5e-5, 1 - 5e-5])
def test_a_tracker_whose_clock_runs_otherwise_is_followed(drift):
    rng = np.random.default_rng(2)
    clock = FrameClock(40.0)
    frames = range(40_000)
    stamps = [
        clock.stamp(k, at) for k, at in zip(frames, polled(frames, 25.0 * drift, rng), strict=True)
    ]
    error = np.array(stamps) / MS - (np.arange(40_000) * 25.0 * drift + 5_000)
    assert np.abs(error[1000:]).max() < 3.0


def test_a_stamp_is_never_later_than_its_question():
    rng = np.random.default_rng(3)
    clock = FrameClock(40.0)
    asked = polled(range(500), 24.0, rng)
    assert all(clock.stamp(k, at) <= at for k, at in enumerate(asked))


def test_a_late_reply_keeps_the_time_of_its_frame():
    clock = FrameClock(40.0)
    for k in range(100):
        clock.stamp(k, k * 25 * MS)
    assert clock.stamp(100, 100 * 25 * MS + 300 * MS) == pytest.approx(100 * 25 * MS, abs=MS)


def test_a_frame_before_its_time_is_reported():
    clock = FrameClock(40.0)
    assert clock.ahead_ns(100, 0) == 0
    clock.stamp(100, 5_000 * MS)
    assert clock.ahead_ns(101, 5_025 * MS) <= 0.01 * MS
    assert clock.ahead_ns(101, 5_090 * MS) == 0
    assert clock.ahead_ns(141, 5_025 * MS) == pytest.approx(1_000 * MS, abs=MS)
