"""What `endoscope bag info` says."""

import pytest

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr_encoding import encode_joint_state, encode_string
from endoscope_bags.information import bag_information
from endoscope_bags.message_types import JOINT_STATE, STRING

MS = 10**6
START = 1_790_000_000 * 10**9


def topic(path, name):
    information = bag_information(open_bag(path))
    return next(topic for topic in information.topics if topic.name == name)


def write(path, numbers, notes=None):
    with BagWriter(path) as writer:
        for k in numbers:
            # Receipt jitters by half a period, the stamps do not.
            log = START + k * MS + (k % 2) * MS // 2
            cdr = encode_joint_state(['a'], START + k * MS, position=[k])
            writer.write_raw('/e/servo_jp', JOINT_STATE, cdr, log, log, k + 1)
        writer.write_raw('/e/state', STRING, encode_string('ENABLED'), START)
        writer.close(notes)
    return path


def test_a_regular_topic(tmp_path):
    path = write(tmp_path / 'bag', range(1000))
    servo = topic(path, '/e/servo_jp')
    assert (servo.message_count, servo.dropouts, servo.missing_s, servo.lost) == (1000, 0, 0, 0)
    assert servo.rate_hz == pytest.approx(1000)
    assert servo.duration_s == pytest.approx(0.999)
    assert servo.longest_gap_s == pytest.approx(1e-3)
    information = bag_information(open_bag(path))
    assert information.message_count == 1001
    assert information.lost == 0
    assert information.start_ns == START


def test_gaps_are_dropouts_and_their_numbers_losses(tmp_path):
    numbers = [k for k in range(1000) if not (100 <= k < 120 or 500 <= k < 505 or k == 700)]
    servo = topic(write(tmp_path / 'bag', numbers), '/e/servo_jp')
    assert servo.dropouts == 2
    assert servo.missing_s == pytest.approx(0.025)
    assert servo.longest_gap_s == pytest.approx(0.021)
    assert servo.lost == 26


def test_the_recorders_own_count_of_losses_comes_first(tmp_path):
    notes = {'lost /e/servo_jp': '3', 'ended': 'on request'}
    path = write(tmp_path / 'bag', range(100), notes)
    assert topic(path, '/e/servo_jp').lost == 3
    assert bag_information(open_bag(path)).notes == {'ended': 'on request'}


def test_an_occasional_topic_has_no_dropouts(tmp_path):
    state = topic(write(tmp_path / 'bag', range(10)), '/e/state')
    assert (state.rate_hz, state.longest_gap_s, state.dropouts, state.duration_s) == (
        None,
        None,
        0,
        0,
    )


def test_the_text_is_a_table(tmp_path):
    lines = str(bag_information(open_bag(write(tmp_path / 'bag', range(50))))).splitlines()
    assert lines[0].endswith('bag: 51 messages over 0.050 s')
    assert lines[1] == 'from 2026-09-21T14:13:20.000000000 UTC, written by endoscope_bags'
    assert lines[2].split()[:3] == ['topic', 'type', 'messages']
    assert lines[3].split() == [
        '/e/servo_jp',
        'sensor_msgs/msg/JointState',
        '50',
        '1000',
        'Hz',
        '0.049',
        's',
        '0',
        '0.001',
        's',
        '0',
    ]
