"""What `endoscope bag info` says."""

import pytest

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr import encode_joint_state, encode_string
from endoscope_bags.information import bag_information
from endoscope_bags.message_types import JOINT_STATE, STRING
from endoscope_bags.topic import LATCHED_QOS

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
    assert (servo.message_count, servo.pauses, servo.gaps, servo.lost) == (1000, 0, 0, 0)
    assert servo.rate_hz == pytest.approx(1000)
    assert servo.duration_s == pytest.approx(0.999)
    assert servo.longest_silence_s == pytest.approx(1e-3)
    information = bag_information(open_bag(path))
    assert information.message_count == 1001
    assert information.lost == 0
    assert information.start_ns == START


def test_gaps_are_silences_with_missing_numbers(tmp_path):
    numbers = [k for k in range(1000) if not (100 <= k < 120 or 500 <= k < 505 or k == 700)]
    servo = topic(write(tmp_path / 'bag', numbers), '/e/servo_jp')
    assert (servo.gaps, servo.pauses) == (2, 0)
    assert servo.missing_s == pytest.approx(0.025)
    assert servo.longest_silence_s == pytest.approx(0.021)
    assert servo.lost == 26


def test_a_publisher_that_rests_has_pauses_and_lost_nothing(tmp_path):
    """Such as a master whose clutch is released: its numbers go on where they stopped."""
    with BagWriter(tmp_path / 'bag') as writer:
        moments = [k for k in range(1000) if not (100 <= k < 220 or 500 <= k < 555)]
        for number, k in enumerate(moments, start=1):
            cdr = encode_joint_state(['a'], START + k * MS, position=[k])
            writer.write_raw('/e/servo_jp', JOINT_STATE, cdr, START + k * MS, None, number)
    servo = topic(tmp_path / 'bag', '/e/servo_jp')
    assert (servo.pauses, servo.gaps, servo.lost) == (2, 0, 0)
    assert servo.paused_s == pytest.approx(0.175)
    assert servo.missing_s == 0.0


def test_several_sources_that_report_now_and_then_are_not_periodic(tmp_path):
    """As on /diagnostics: the median interval is nobody's period."""
    with BagWriter(tmp_path / 'bag') as writer:
        for second in range(20):
            for source, offset in enumerate((0, 20, 60, 100, 180, 380)):
                at = START + (second * 1000 + offset) * MS
                cdr = encode_joint_state(['a'], at, position=[source])
                writer.write_raw('/diagnostics', JOINT_STATE, cdr, at, at, second + 1)
    diagnostics = topic(tmp_path / 'bag', '/diagnostics')
    assert (diagnostics.pauses, diagnostics.gaps) == (0, 0)
    assert diagnostics.rate_hz == pytest.approx(6.0, rel=0.05)


def test_what_nothing_numbers_may_be_lost_unless_it_is_latched(tmp_path, monkeypatch):
    monkeypatch.setattr('endoscope_bags.information.LIBRARY', 'another recorder')
    with BagWriter(tmp_path / 'bag') as writer:
        writer.add_topic('/e/model', JOINT_STATE, [LATCHED_QOS])
        for k in [k for k in range(1000) if not 100 <= k < 220]:
            for name in ('/e/servo_jp', '/e/model'):
                cdr = encode_joint_state(['a'], START + k * MS, position=[k])
                writer.write_raw(name, JOINT_STATE, cdr, START + k * MS)
    servo, model = (topic(tmp_path / 'bag', name) for name in ('/e/servo_jp', '/e/model'))
    assert (servo.pauses, servo.gaps, servo.lost) == (0, 1, None)
    assert (model.pauses, model.gaps, model.lost) == (1, 0, None)


def test_the_recorders_own_count_of_losses_comes_first(tmp_path):
    notes = {'lost /e/servo_jp': '3', 'ended': 'on request'}
    path = write(tmp_path / 'bag', range(100), notes)
    assert topic(path, '/e/servo_jp').lost == 3
    assert bag_information(open_bag(path)).notes == {'ended': 'on request'}


def test_an_occasional_topic_has_no_silences(tmp_path):
    state = topic(write(tmp_path / 'bag', range(10)), '/e/state')
    assert (state.rate_hz, state.longest_silence_s, state.duration_s) == (None, None, 0)
    assert (state.pauses, state.gaps) == (0, 0)
