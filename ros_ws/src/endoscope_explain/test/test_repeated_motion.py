"""What counts as motion that has been made before."""

import numpy as np
import pytest

from endoscope_explain.search.repetition import LEAST_SHARE, share_seen_before

TIME = 1e-3 * np.arange(40_000)


@pytest.mark.parametrize(
    ('command', 'share'),
    [
        (np.sin(TIME[:6283]), 0.0),
        (np.sin(TIME[:9000]), 1.0 - 2.0 * np.pi / 9.0),
        (np.sin(TIME), 1.0 - 2.0 * np.pi / 40.0),
        (0.02 * TIME, 0.0),
        (np.zeros(9000), 8.0 / 9.0),
        (np.where(TIME < 20.0, 0.5, 0.0), 38.0 / 40.0),
    ],
    ids=['one cycle', 'the calibration', 'many cycles', 'ramp', 'rest', 'holds'],
)
def test_share_of_the_motion_that_was_seen_before(command, share):
    assert share_seen_before(command) == pytest.approx(share, abs=0.06)


def test_one_cycle_is_too_little_and_the_calibration_is_enough():
    assert (
        share_seen_before(np.sin(TIME[:6300]))
        < LEAST_SHARE
        < share_seen_before(np.sin(TIME[:9000]))
    )


def test_the_share_does_not_depend_on_the_tick():
    command = np.sin(TIME[:9000])
    coarse = share_seen_before(command[::5], 5e-3)
    assert coarse == pytest.approx(share_seen_before(command), abs=0.02)
