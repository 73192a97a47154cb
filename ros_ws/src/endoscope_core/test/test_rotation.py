import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from endoscope_core.kinematics import (
    about_z,
    angle_between,
    conjugate,
    mean_orientation,
    multiply,
    rotate,
    unit_quaternion,
)

vectors = arrays(np.float64, 3, elements=st.floats(-3.0, 3.0))


def quaternion(rotation_vector):
    return Rotation.from_rotvec(rotation_vector).as_quat()


@given(vectors, vectors, vectors)
def test_products_and_turned_vectors_are_those_of_scipy(a, b, v):
    first, second = Rotation.from_rotvec(a), Rotation.from_rotvec(b)
    product = Rotation.from_quat(multiply(first.as_quat(), second.as_quat()))
    assert (product.inv() * (first * second)).magnitude() < 1e-7
    np.testing.assert_allclose(rotate(first.as_quat(), v), first.apply(v), atol=1e-12)


@given(vectors, vectors)
def test_angle_between_is_that_of_scipy_whatever_the_sign(a, b):
    expected = (Rotation.from_rotvec(a).inv() * Rotation.from_rotvec(b)).magnitude()
    assert angle_between(quaternion(a), quaternion(b)) == pytest.approx(expected, abs=1e-7)
    assert angle_between(-quaternion(a), quaternion(b)) == pytest.approx(expected, abs=1e-7)


@given(vectors)
def test_the_inverse_undoes(a):
    np.testing.assert_allclose(
        multiply(conjugate(quaternion(a)), quaternion(a)), (0, 0, 0, 1), atol=1e-12
    )


@given(vectors, st.integers(0, 2**32 - 1))
def test_the_mean_lies_amid_and_does_not_see_signs(a, seed):
    rng = np.random.default_rng(seed)
    noisy = Rotation.from_rotvec(a) * Rotation.from_rotvec(rng.normal(0.0, 0.005, (200, 3)))
    signs = rng.choice((-1.0, 1.0), (200, 1))
    mean = mean_orientation(signs * noisy.as_quat())
    assert angle_between(mean, quaternion(a)) < 0.003
    assert angle_between(mean, noisy.mean().as_quat()) < 1e-6


def test_turning_about_z():
    np.testing.assert_allclose(rotate(about_z(math.pi / 2), (1, 0, 0)), (0, 1, 0), atol=1e-15)


@pytest.mark.parametrize('bad', [(0, 0, 0, 0), (math.nan, 0, 0, 1), (math.inf, 0, 0, 1)])
def test_what_is_no_orientation_is_refused(bad):
    with pytest.raises(ValueError, match='not an orientation'):
        unit_quaternion(bad)


@pytest.mark.parametrize('bad', [np.zeros((0, 4)), [[math.nan, 0, 0, 1]], [[0, 0, 1]]])
def test_the_mean_of_nothing_is_refused(bad):
    with pytest.raises(ValueError, match='at least one finite'):
        mean_orientation(bad)
