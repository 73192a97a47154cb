import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_core.control import RecursiveHysteresisController, RecursiveHysteresisSettings
from endoscope_core.control.recursive_hysteresis import RecursiveHysteresisJoint

C = RecursiveHysteresisSettings()


def teach(law, truth, seconds, start=0.0, noise=0.0, seed=0):
    generator = np.random.default_rng(seed)
    for time in np.arange(start, start + seconds, 0.025):
        desired, direction = math.sin(time), math.copysign(1.0, math.cos(time))
        v = law.correction(desired, direction, 0.025)
        missing = v - (truth[0] * desired + truth[1] * direction + truth[2])
        error = C.transmission_gain * missing + noise * generator.normal()
        law.learn(error, v, desired, direction, 0.025)


@given(st.floats(-0.3, 0.3), st.floats(-0.5, 0.5), st.floats(-0.1, 0.1))
def test_it_finds_gain_backlash_and_offset_within_a_cycle(gain, backlash, offset):
    law = RecursiveHysteresisJoint(C)
    teach(law, (gain, backlash, offset), 2.0 * math.pi, noise=0.004)
    np.testing.assert_allclose(law.estimates, (gain, backlash, offset), atol=0.02)


def test_it_follows_a_change_and_forgets_nothing_at_rest():
    law = RecursiveHysteresisJoint(C)
    teach(law, (0.1, 0.2, 0.0), 10.0)
    teach(law, (0.1, 0.5, 0.0), 4.0 * math.pi, start=10.0)
    np.testing.assert_allclose(law.estimates, (0.1, 0.5, 0.0), atol=0.03)
    known = law.estimates.copy()
    for _ in range(40 * 60):
        law.learn(0.0, law.correction(0.0, 1.0, 0.025), 0.0, 1.0, 0.025)
    np.testing.assert_allclose(law.estimates, known, atol=1e-6)
    assert np.trace(law.covariance) < 1.0


@given(
    st.lists(
        st.tuples(st.floats(-50, 50), st.floats(-2, 2), st.floats(-2, 2), st.floats(-1, 1)),
        max_size=50,
    )
)
def test_estimates_are_bounded_and_the_covariance_positive(samples):
    law = RecursiveHysteresisJoint(C)
    for error, correction, desired, direction in samples:
        law.learn(error, correction, desired, direction, 0.025)
    assert np.all(np.abs(law.estimates) <= (C.gain_limit, C.backlash_limit, C.offset_limit))
    assert np.all(np.linalg.eigvalsh(law.covariance) > 0.0)


def test_crossing_the_dead_zone_is_not_learnt_from():
    law = RecursiveHysteresisJoint(C)
    law.learn(0.5, 0.0, 1.0, 0.5, 0.025)
    assert not np.any(law.estimates)


def test_settings_out_of_range_are_refused():
    with pytest.raises(ValueError, match='memory'):
        RecursiveHysteresisSettings(memory=0.0)
    with pytest.raises(ValueError, match='noise'):
        RecursiveHysteresisSettings(noise=math.nan)
    assert RecursiveHysteresisController(2).weight == 0.0
