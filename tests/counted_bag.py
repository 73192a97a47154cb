"""A recording of a joint that counts, and what an error has to be like."""

from endoscope_bags import BagWriter
from endoscope_bags.cdr import encode_joint_state
from endoscope_bags.message_types import JOINT_STATE

MS = 10**6
N = 400
TOPIC = '/rig/slave/servo_jp'


def write_bag(path):
    with BagWriter(path, chunk_seconds=0.02) as writer:
        for k in range(N):
            data = encode_joint_state(['bend_x'], k * MS, position=[k])
            writer.write_raw(TOPIC, JOINT_STATE, data, k * MS, k * MS, k + 1)
    return path


def says_one_line(error):
    assert str(error)
    assert str(error).isprintable()
