"""The instrument as other programs draw it: the URDF says what the transforms do."""

import math
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from endoscope_core.kinematics import Vertebrae, robot_description, tip_pose
from endoscope_core.kinematics.constant_curvature import VERTEBRAE

SECTION = Vertebrae(0.02, 'endoscope_base')
ROBOT = ElementTree.fromstring(robot_description(SECTION))
AXES = {'1 0 0': np.array([1.0, 0.0, 0.0]), '0 1 0': np.array([0.0, 1.0, 0.0])}
reach = st.floats(-1.75, 1.75)


def pose(translation=(0.0, 0.0, 0.0), rotation=None):
    matrix = np.eye(4)
    matrix[:3, 3] = translation
    if rotation is not None:
        matrix[:3, :3] = rotation.as_matrix()
    return matrix


def poses_of_the_urdf(angles):
    """Where each link is in the base's frame, as a robot state publisher works it out."""
    turned = dict(zip(SECTION.joint_names, angles, strict=True))
    found = {SECTION.base_frame: np.eye(4)}
    for joint in ROBOT.iter('joint'):
        origin = joint.find('origin')
        step = pose(
            [float(v) for v in origin.get('xyz').split()],
            Rotation.from_euler('xyz', [float(v) for v in origin.get('rpy').split()]),
        )
        if joint.get('type') == 'revolute':
            axis = AXES[joint.find('axis').get('xyz')]
            step = step @ pose(rotation=Rotation.from_rotvec(axis * turned[joint.get('name')]))
        found[joint.find('child').get('link')] = found[joint.find('parent').get('link')] @ step
    return found


def poses_of_the_transforms(angles):
    found = {SECTION.base_frame: np.eye(4)}
    for parent, child, translation, rotation in SECTION.transforms(angles):
        found[child] = found[parent] @ pose(translation, Rotation.from_quat(rotation))
    return found


def test_nothing_has_to_be_fetched():
    shapes = {shape.tag for geometry in ROBOT.iter('geometry') for shape in geometry}
    assert shapes == {'cylinder', 'sphere'}
    named = {material.get('name') for material in ROBOT.findall('material')}
    assert {v.find('material').get('name') for v in ROBOT.iter('visual')} == named


@given(reach, reach)
def test_the_transforms_are_those_of_the_urdf(x, y):
    angles = SECTION.joint_angles((x, y))
    described = poses_of_the_urdf(angles)
    for link, where in poses_of_the_transforms(angles).items():
        # The text has six digits of a length.
        np.testing.assert_allclose(where, described[link], atol=1e-7)


@given(reach, reach)
def test_the_tip_is_that_of_constant_curvature(x, y):
    tip = poses_of_the_transforms(SECTION.joint_angles((x, y)))['endoscope_tip']
    position, orientation = tip_pose((x, y), SECTION.length)
    np.testing.assert_allclose(tip[:3, :3], Rotation.from_quat(orientation).as_matrix(), atol=1e-12)
    half = 0.5 * math.hypot(x, y) / VERTEBRAE
    arc = math.tan(half) / half if half else 1.0
    np.testing.assert_allclose(arc * tip[:3, 3], position, atol=2e-5 * SECTION.length)
    assert np.linalg.norm(tip[:3, 3] - position) < 0.004 * SECTION.length


def test_every_joint_of_an_axis_turns_by_the_same_angle_within_its_limits():
    angles = dict(zip(SECTION.joint_names, SECTION.joint_angles((1.7, -1.2)), strict=True))
    assert len({angle for name, angle in angles.items() if name.endswith('_x')}) == 1
    assert len({angle for name, angle in angles.items() if name.endswith('_y')}) == 1
    limits = {
        j.get('name'): float(j.find('limit').get('upper'))
        for j in ROBOT.iter('joint')
        if j.get('type') == 'revolute'
    }
    assert all(abs(angle) < limits[name] for name, angle in angles.items())


def test_refuses_half_a_turn():
    with pytest.raises(ValueError, match='half a turn'):
        SECTION.joint_angles((math.pi, 0.1))
