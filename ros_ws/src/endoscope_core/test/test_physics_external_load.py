"""A load that goes and comes again."""

import numpy as np
import pytest
from physics_rig import LOOSE, run

TIME = 1e-3 * np.arange(8000)
FULL = 9e-4 / 0.0045
LOAD = {'moment_nm': 9e-4, 'time_s': 1.0}


def bent(**given):
    return run(np.zeros(8000), {'external_load': LOAD | given}, **LOOSE).bending


def test_a_load_goes_when_it_has_been_held():
    angle = bent(hold_s=2.0)
    np.testing.assert_allclose(angle[(TIME > 1.1) & (TIME < 2.99)], FULL, atol=1e-6)
    np.testing.assert_allclose(angle[(TIME < 0.99) | (TIME > 3.1)], 0.0, atol=1e-6)


@pytest.mark.parametrize('duration', [0.0, 0.3])
def test_a_load_comes_again_every_period(duration):
    angle = bent(hold_s=0.5, period_s=1.5, duration_s=duration)
    for onset in (1.0, 2.5, 4.0, 5.5, 7.0):
        inside = np.abs(TIME - onset - 0.25) < 0.25 - duration / 2.0 - 0.02
        outside = np.abs(TIME - onset - 1.0) < 0.5 - duration / 2.0 - 0.03
        np.testing.assert_allclose(angle[inside], FULL, atol=1e-3)
        np.testing.assert_allclose(angle[outside], 0.0, atol=1e-3)
    assert np.abs(angle[TIME < 0.8]).max() < 1e-9


def test_a_load_that_is_held_longer_than_its_period_stays():
    angle = bent(hold_s=1.6, period_s=1.5, duration_s=0.2)
    np.testing.assert_allclose(angle[TIME > 1.2], FULL, atol=1e-6)


def test_its_moment_has_no_jump_where_a_pulse_follows_another():
    angle = bent(hold_s=0.9, period_s=1.0, duration_s=0.6)
    assert np.abs(np.diff(angle)).max() < 3.0 * FULL / 600.0
