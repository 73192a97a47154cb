"""Reading, writing, checking and recovering rosbag2 MCAP recordings, free of ROS."""

from endoscope_bags.bag_writer import BagWriter
from endoscope_bags.errors import BagError
from endoscope_bags.joint_state_series import JointStateSeries, PoseSeries
from endoscope_bags.message_stream import MessageStream
from endoscope_bags.recording import Recording, open_bag
from endoscope_bags.topic import RawMessage, Topic

__all__ = [
    'BagError',
    'BagWriter',
    'JointStateSeries',
    'MessageStream',
    'PoseSeries',
    'RawMessage',
    'Recording',
    'Topic',
    'open_bag',
]
