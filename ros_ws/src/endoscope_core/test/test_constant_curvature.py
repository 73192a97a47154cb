import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from endoscope_core.kinematics import bending_from_orientation, centre_line, tip_pose

angles = st.floats(-2.2, 2.2)


@given(angles, angles, st.floats(-3.0, 3.0))
def test_a_twist_of_the_sensor_about_its_own_axis_changes_nothing(x, y, twist):
    if math.hypot(x, y) >= 3.0:
        return
    _, orientation = tip_pose((x, y), 0.02)
    twisted = Rotation.from_quat(orientation) * Rotation.from_rotvec((0.0, 0.0, twist))
    np.testing.assert_allclose(bending_from_orientation(twisted.as_quat()), (x, y), atol=1e-7)


@given(angles, angles)
def test_orientation_is_the_rotation_by_both_angles(x, y):
    if math.hypot(x, y) >= 3.1:
        return
    _, orientation = tip_pose((x, y), 0.02)
    expected = Rotation.from_rotvec((-y, x, 0.0))
    assert (expected.inv() * Rotation.from_quat(orientation)).magnitude() < 1e-9


@given(angles, angles)
def test_position_is_the_integral_of_the_tangent_along_the_arc(x, y):
    if math.hypot(x, y) >= 3.1:
        return
    s = (np.arange(2000) + 0.5) / 2000
    tangent = Rotation.from_rotvec(np.outer(s, (-y, x, 0.0))).apply((0.0, 0.0, 1.0))
    np.testing.assert_allclose(tip_pose((x, y), 1.0)[0], tangent.mean(axis=0), atol=1e-6)


@pytest.mark.parametrize('bad', [(0, 0, 0, 0), (math.nan, 0, 0, 1), (1, 0, 0, 0)])
def test_refuses_what_has_no_bending(bad):
    with pytest.raises(ValueError, match=r'orientation|straight back'):
        bending_from_orientation(bad)


def test_refuses_half_a_turn():
    with pytest.raises(ValueError, match='half a turn'):
        tip_pose((math.pi, 0.1), 0.02)


@given(st.floats(-1.7, 1.7), st.floats(-1.7, 1.7), st.integers(1, 39))
def test_a_centre_line_ends_where_a_shorter_section_would(x, y, k):
    line = centre_line((x, y), 0.02, 40)
    share = k / 39
    tip, _ = tip_pose((share * x, share * y), share * 0.02)
    np.testing.assert_allclose(line[0], 0.0, atol=1e-15)
    np.testing.assert_allclose(line[k], tip, atol=1e-12)
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    assert np.ptp(steps) < 1e-9
