"""What is recorded for programs that draw robots: the instrument, its joints and its links."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from simulated_graph import SimulatedGraph

from endoscope_bags import open_bag
from endoscope_bags.message_types import TF_MESSAGE, message_type, typestore
from endoscope_core.kinematics import tip_pose
from endoscope_core.rig import shipped_rig
from endoscope_nodes.graph import SHOWING_NODES
from endoscope_nodes.nodes.recorder import RecorderNode

RIG = replace(shipped_rig(), instrument=replace(shipped_rig().instrument, section_length=0.03))
JOINT_STATES = '/endoscope/joint_states'
MEASURED = '/endoscope/slave/measured_js'


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Two seconds of a motion."""
    path = tmp_path_factory.mktemp('instrument') / 'bag'
    with SimulatedGraph(
        extra=(*SHOWING_NODES, RecorderNode),
        overrides={'recorder': {'bag': str(path)}},
        rig=RIG,
        tick_rate=250,
    ) as graph:
        graph.enable()
        graph.set('master', source='motion', motion='non_periodic')
        graph.advance(2.0)
    assert graph.nodes['recorder'].last_report.complete
    return open_bag(path)


def messages(bag, topic):
    kind = bag.topics[topic].type
    return [typestore().deserialize_cdr(m.data, kind) for m in bag.messages([topic])]


def stamp_ns(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec


@pytest.mark.parametrize('topic', ['/robot_description', '/endoscope/robot_description'])
def test_the_description_is_there_once_for_whoever_comes_late(bag, topic):
    (message,) = messages(bag, topic)
    robot = ElementTree.fromstring(message.data)
    assert robot.tag == 'robot'
    assert bag.topics[topic].qos[0].durability == 'transient_local'


def test_every_joint_has_its_angle_twenty_times_a_second(bag):
    robot = ElementTree.fromstring(messages(bag, '/robot_description')[0].data)
    turning = [j.get('name') for j in robot.iter('joint') if j.get('type') == 'revolute']
    states = messages(bag, JOINT_STATES)
    assert all(state.name == turning == state.name[: len(state.position)] for state in states)
    gaps = np.diff([stamp_ns(state.header) for state in states]) * 1e-9
    np.testing.assert_allclose(gaps, 0.05, atol=2e-3)
    assert len(states) > 35


def test_the_links_are_where_the_tracker_saw_the_tip(bag):
    """With the definition of their type, so that nobody needs its package."""
    assert bag.topics['/tf'].type == TF_MESSAGE
    assert bag.topics['/tf'].definition == message_type(TF_MESSAGE).definition
    seen = {stamp_ns(m.header): m.position for m in messages(bag, MEASURED)}
    told = messages(bag, '/tf')
    assert len(told) == len(messages(bag, JOINT_STATES))
    farthest = 0.0
    for message in told:
        where, turned = np.zeros(3), Rotation.identity()
        frame = 'endoscope_base'
        for transform in message.transforms:
            assert transform.header.frame_id == frame
            frame = transform.child_frame_id
            step, turn = transform.transform.translation, transform.transform.rotation
            where = where + turned.apply([step.x, step.y, step.z])
            turned = turned * Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
        assert frame == 'endoscope_tip'
        bending = seen[stamp_ns(message.transforms[-1].header)]
        farthest = max(farthest, float(np.hypot(*bending)))
        position, orientation = tip_pose(bending, 0.03)
        np.testing.assert_allclose(where, position, atol=0.004 * 0.03)
        assert (turned.inv() * Rotation.from_quat(orientation)).magnitude() < 1e-9
    assert farthest > 0.3
