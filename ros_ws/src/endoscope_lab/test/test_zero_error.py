"""The zero of a load cell as a calibration shows it."""

import numpy as np
import pytest

from endoscope_core.calibration import words_of, zero_errors
from endoscope_core.signals import CALIBRATION_MOTIONS, calibration_motion
from endoscope_lab.dataset import configuration_of_size, random_instrument, record_calibration

OFFSETS = np.array([0.58, -0.4, 0.0, 0.1])
WIRES = ('x_pos', 'x_neg', 'y_pos', 'y_neg')


@pytest.mark.parametrize('motion', CALIBRATION_MOTIONS)
def test_a_wire_that_goes_slack_shows_the_zero_of_its_cell(motion):
    instrument = random_instrument(np.random.default_rng(4))
    tube = configuration_of_size(instrument, np.deg2rad(70.0))
    tension = record_calibration(tube.plant, 1, calibration_motion(motion)).tension
    np.testing.assert_allclose(zero_errors(tension + OFFSETS), OFFSETS, atol=0.03)


def test_only_large_zero_errors_are_reported():
    assert words_of(OFFSETS, WIRES) == (
        'zero of a load cell is off: x_pos by +0.58 N, x_neg by -0.40 N; set it again'
    )
    assert words_of(0.2 * OFFSETS, WIRES) == ''
