import numpy as np
import pytest

from endoscope_core.calibration import TensionGapError, TensionRecord

MS = 1_000_000
START = 5 * MS


def tension(stamp_ns):
    t = (stamp_ns - START) / MS
    return (t, 2.0 * t, -t, 7.0)


def filled(stamps, samples=1000):
    record = TensionRecord(4, START, MS, samples)
    for stamp in stamps:
        record.add(round(stamp), tension(round(stamp)))
    return record


def test_a_full_record_is_given_back_sample_by_sample():
    record = filled(range(START - 3 * MS, START + 1005 * MS, MS))
    assert record.complete
    np.testing.assert_allclose(record.resampled(), [tension(START + k * MS) for k in range(1000)])


@pytest.mark.parametrize('rate', [100.0, 200.0, 450.0, 990.0, 1200.0])
def test_any_rate_from_100_hz_on_will_do_with_uneven_stamps(rate):
    generator = np.random.default_rng(round(rate))
    number = np.arange(-1, round(1.02 * rate))
    stamps = START + (number + generator.uniform(-0.2, 0.2, len(number))) * 1e9 / rate
    record = filled(stamps)
    assert record.complete
    np.testing.assert_allclose(record.resampled()[:, 0], np.arange(1000), atol=1e-5)


def test_slower_readings_are_refused_with_their_interval():
    with pytest.raises(TensionGapError, match=r'14\.\d ms apart; at most 12\.5 ms'):
        filled(np.arange(START, START + 1020 * MS, MS * 1000 / 70)).resampled()


def test_short_gaps_are_bridged_and_many_lost_readings_only_lower_the_rate():
    stamps = [START + k * MS for k in range(1001) if not 100 <= k < 139]
    np.testing.assert_allclose(filled(stamps).resampled()[:, 0], np.arange(1000), atol=1e-9)
    lossy = filled([START + k * MS for k in range(1001) if k % 10])
    np.testing.assert_allclose(lossy.resampled()[1:, 0], np.arange(1, 1000), atol=1e-9)


def test_many_gaps_are_refused_though_each_could_be_bridged():
    stamps = [START + k * MS for k in range(1001) if k % 40 < 2]
    with pytest.raises(TensionGapError, match='ms apart'):
        filled(stamps).resampled()


@pytest.mark.parametrize(
    ('hole', 'words'),
    [
        (range(100, 140), r'41 ms from 0\.099 s'),
        (range(41), r'no tension for 41 ms from 0\.000 s'),
        (range(959, 1001), r'no tension for 41 ms from 0\.958 s'),
    ],
)
def test_a_long_gap_is_refused_with_its_place(hole, words):
    stamps = [START + k * MS for k in range(1001) if k not in hole]
    with pytest.raises(TensionGapError, match=words):
        filled(stamps).resampled()


def test_old_and_repeated_stamps_are_left_out():
    record = filled(range(START, START + 1001 * MS, MS))
    before = record.resampled()
    record.add(START + 10 * MS, (99.0,) * 4)
    np.testing.assert_array_equal(record.resampled(), before)
