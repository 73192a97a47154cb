import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from endoscope_core.kinematics import (
    RegistrationError,
    bending_from_orientation,
    register_straight,
    tip_pose,
)

LENGTH = 0.02
COUNT = np.arange(40)
angles = st.floats(-2.0, 2.0)


class Rig:
    """An instrument somewhere in a tracker's volume, its sensor turned about its own axis."""

    def __init__(self, seed, roll=0.0):
        rng = np.random.default_rng(seed)
        self.roll = roll
        self.base = Rotation.from_quat(rng.normal(size=4))
        self.place = rng.uniform(-0.3, 0.3, 3)
        self.rng = rng

    def sensor(self, bending, noise_angle=0.0, noise_distance=0.0):
        position, orientation = tip_pose(bending, LENGTH)
        mounted = Rotation.from_rotvec((0.0, 0.0, self.roll))
        jitter = Rotation.from_rotvec(self.rng.normal(0.0, noise_angle / math.sqrt(3), 3))
        turned = self.base * Rotation.from_quat(orientation) * mounted * jitter
        shift = self.rng.normal(0.0, noise_distance / math.sqrt(3), 3)
        return self.place + self.base.apply(position) + shift, turned.as_quat()

    def straight(self, count=40, **noise):
        return list(zip(*(self.sensor((0.0, 0.0), **noise) for _ in range(count)), strict=True))


@given(angles, angles, st.floats(-3.1, 3.1), st.integers(0, 1000))
def test_any_bending_is_found_wherever_the_tracker_stands(x, y, roll, seed):
    if math.hypot(x, y) >= 2.9:
        return
    rig = Rig(seed, roll)
    registration = register_straight(*rig.straight())
    position, orientation = registration.in_base(*rig.sensor((x, y)), roll=roll, length=LENGTH)
    np.testing.assert_allclose(bending_from_orientation(orientation), (x, y), atol=1e-6)
    np.testing.assert_allclose(position, tip_pose((x, y), LENGTH)[0], atol=1e-9)


def test_averaging_takes_the_noise_out_of_the_zero():
    rig = Rig(5)
    noisy = rig.straight(noise_angle=0.008, noise_distance=0.0005)
    registration = register_straight(*noisy)
    _, orientation = registration.in_base(*rig.sensor((0.0, 0.0)), roll=0.0, length=LENGTH)
    assert np.abs(bending_from_orientation(orientation)).max() < 0.002


@pytest.mark.parametrize(
    ('bendings', 'shifts', 'words'),
    [
        (np.zeros(29), np.zeros(29), r'29 readings.*30 are needed'),
        (0.05 * np.sin(COUNT), 0.0 * COUNT, 'turned by'),
        (0.02 * COUNT / 40, 0.0 * COUNT, 'kept turning'),
        (0.0 * COUNT, 0.002 * np.sin(COUNT), 'moved by'),
        (0.0 * COUNT, 0.0015 * COUNT / 40, 'kept moving'),
    ],
)
def test_what_does_not_stand_still_and_straight_is_refused(bendings, shifts, words):
    rig = Rig(2)
    positions, orientations = zip(*(rig.sensor((b, 0.0)) for b in bendings), strict=True)
    moved = [p + (0.0, s, 0.0) for p, s in zip(positions, shifts, strict=True)]
    with pytest.raises(RegistrationError, match=words):
        register_straight(moved, orientations)
