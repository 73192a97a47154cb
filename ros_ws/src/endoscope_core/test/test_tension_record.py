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
        record.add(stamp, tension(stamp))
    return record


def test_a_full_record_is_given_back_sample_by_sample():
    record = filled(range(START - 3 * MS, START + 1005 * MS, MS))
    assert record.complete
    np.testing.assert_allclose(record.resampled(), [tension(START + k * MS) for k in range(1000)])


def test_stamps_between_the_grid_are_interpolated():
    record = filled(range(START - MS // 2, START + 1001 * MS, MS))
    np.testing.assert_allclose(
        record.resampled(), [tension(START + k * MS) for k in range(1000)], atol=1e-9
    )


def test_short_gaps_are_bridged():
    stamps = [START + k * MS for k in range(1001) if not 100 <= k < 115]
    np.testing.assert_allclose(filled(stamps).resampled()[:, 0], np.arange(1000), atol=1e-9)


@pytest.mark.parametrize(
    ('hole', 'words'),
    [
        (range(100, 130), r'31 ms from 0\.099 s'),
        (range(25), 'no tension'),
        (range(975, 1001), 'no tension'),
    ],
)
def test_a_long_gap_is_refused_with_its_place(hole, words):
    stamps = [START + k * MS for k in range(1001) if k not in hole]
    with pytest.raises(TensionGapError, match=words):
        filled(stamps).resampled()


def test_many_short_gaps_are_refused():
    stamps = [START + k * MS for k in range(1001) if k % 10]
    with pytest.raises(TensionGapError, match=r'10\.0 % of the tensions'):
        filled(stamps).resampled()


def test_nothing_at_all_is_refused():
    with pytest.raises(TensionGapError):
        TensionRecord(4, START, MS, 1000).resampled()


def test_old_and_repeated_stamps_are_left_out():
    record = filled(range(START, START + 1001 * MS, MS))
    before = record.resampled()
    record.add(START + 10 * MS, (99.0,) * 4)
    np.testing.assert_array_equal(record.resampled(), before)
