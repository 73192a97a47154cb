"""Recordings made elsewhere, where there are any: ours and rosbags' reading agree."""

import numpy as np
import pytest
from outside_data import CASES, needs
from rosbags.highlevel import AnyReader

from endoscope_bags import open_bag
from endoscope_bags.information import bag_information

RECORDINGS = sorted(CASES.glob('**/*.second.mcap'))
TOPICS = (
    'motor/servo_jp',
    'motor/measured_js',
    'wires/measured_js',
    'slave/measured_js',
)

pytestmark = needs(RECORDINGS[0] if RECORDINGS else CASES / 'second.mcap')


@pytest.mark.parametrize('path', RECORDINGS[:1], ids=lambda path: path.stem)
def test_all_numbers_are_those_that_rosbags_reads(path):
    bag = open_bag(path)
    with AnyReader([path]) as reader:
        for name in TOPICS:
            series = bag.joint_state(name, order='recorded')
            connections = [c for c in reader.connections if c.topic.endswith('/' + name)]
            messages = [
                reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(connections)
            ]
            stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in messages]
            np.testing.assert_array_equal(series.stamp_ns, stamps)
            assert all(tuple(m.name) == series.names for m in messages)
            for quantity in ('position', 'velocity', 'effort'):
                ours = getattr(series, quantity)
                theirs = np.array([getattr(m, quantity) for m in messages])
                if ours is None:
                    assert theirs.size == 0
                else:
                    np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize('path', RECORDINGS, ids=lambda path: path.stem)
def test_every_recording_opens_and_has_what_analysis_needs(path):
    bag = open_bag(path)
    for name in TOPICS:
        series = bag.joint_state(name)
        assert len(series) > 100
        assert (np.diff(series.stamp_ns) > 0).all()
    information = bag_information(bag)
    assert information.duration_s > 10.0
    assert all(topic.lost is None for topic in information.topics)
