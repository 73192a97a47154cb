"""Rates of bending for a velocity of the tip, against differences of the tip's own pose."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from endoscope_core.kinematics import TipVelocity, bending_rate, tip_pose

LENGTH = 0.02
STEP = 1e-5
STILL = (0.0, 0.0, 0.0)
ANGLES = st.tuples(st.floats(-1.75, 1.75), st.floats(-1.75, 1.75))
RATES = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))


def tip_velocity(bending, rate):
    """Linear and angular velocity of the tip in its own frame, by central differences."""
    before, after = (
        tip_pose(np.add(bending, side * STEP * np.array(rate)), LENGTH) for side in (-0.5, 0.5)
    )
    here = Rotation.from_quat(tip_pose(bending, LENGTH)[1]).inv()
    spin = Rotation.from_quat(before[1]).inv() * Rotation.from_quat(after[1])
    return here.apply(after[0] - before[0]) / STEP, spin.as_rotvec() / STEP


@given(ANGLES, RATES)
def test_the_tip_turns_and_moves_across_its_axis_as_asked(bending, rate):
    linear, angular = tip_velocity(bending, rate)
    for velocity in (
        TipVelocity(STILL, (angular[0], angular[1], 0.0)),
        TipVelocity((linear[0], linear[1], 0.0), STILL),
    ):
        found = bending_rate(velocity, bending, LENGTH)
        assert found == pytest.approx(rate, abs=1e-3)
        assert not velocity.ignored


def test_a_straight_section_turns_as_the_tip_and_moves_by_half_its_length():
    assert bending_rate(TipVelocity(STILL, (0.3, 0.2, 0.0)), (0.0, 0.0), LENGTH) == (0.2, -0.3)
    across = bending_rate(TipVelocity((1e-3, -2e-3, 0.0), STILL), (0.0, 0.0), LENGTH)
    assert across == pytest.approx((0.1, -0.2))


def test_what_two_angles_cannot_follow_is_said_and_changes_nothing():
    asked = TipVelocity((0.01, 0.0, 0.02), (0.0, 0.4, -0.3))
    assert bending_rate(asked, (0.5, 0.2), LENGTH) == bending_rate(
        TipVelocity(STILL, (0.0, 0.4, 0.0)), (0.5, 0.2), LENGTH
    )
    assert asked.ignored == (
        'linear.z, angular.z, linear.x and linear.y beside angular.x and angular.y'
    )
    assert bending_rate(TipVelocity((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), (0.5, 0.2), LENGTH) == (0, 0)


def test_half_a_turn_has_no_rate():
    with pytest.raises(ValueError, match='half a turn'):
        bending_rate(TipVelocity(STILL, (1.0, 0.0, 0.0)), (math.pi, 0.0), LENGTH)
