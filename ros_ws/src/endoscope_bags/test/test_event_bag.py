"""Bags of faults and marks: what led to them, what was in force, and why they were kept."""

import pytest

from endoscope_bags import BagError, open_bag
from endoscope_bags.cdr import encode_string
from endoscope_bags.copying import cut, recover
from endoscope_bags.event_bag import (
    FAULT,
    MARK,
    Event,
    EventBag,
    event_bags,
    event_from_text,
    events_of,
    new_event_bag,
)
from endoscope_bags.listing import bags_in
from endoscope_bags.message_types import STRING
from endoscope_bags.recent_messages import RecentMessages, packed
from endoscope_bags.recording_session import Arrival, RecordingSession

MS = 10**6
START = 1_790_000_000 * 10**9
STREAM, STATE = 0, 1
REASON = 'tension of wire_x_pos is 41.2 N: more\nthan 40 N'


def message(k, topic=STREAM, sequence=None):
    at = START + k * MS
    text = encode_string(f'{topic} {k}')
    return Arrival(at, topic, k + 1 if sequence is None else sequence, at, text)


def filled(seconds=1.0, count=5000):
    """A ring of the last second of five, with a state that was published once at the beginning."""
    recent = RecentMessages(seconds, 10**8)
    recent.add([message(0, STATE, 1)], {STATE}, START)
    for k in range(count):
        recent.add([message(k)], {STATE}, START + k * MS)
    return recent


def session_in(folder, kind=FAULT):
    def opened(records):
        session = RecordingSession(new_event_bag(folder, kind, 50), records=records)
        session.add_topic('/stream', STRING)
        session.add_topic('/state', STRING)
        return session

    return opened


def written(folder):
    """A bag of a fault whose reason came late, with a mark while it was written."""
    event = EventBag(filled(), FAULT, START + 4999 * MS)
    event.arrive(packed([message(5000)]), 1)
    assert event.lacks_reason
    event.explain(REASON)
    event.begin(session_in(folder))
    event.add(MARK, START + 5001 * MS, 'seen by the operator')
    for k in range(5001, 5100):
        event.arrive(packed([message(k)]), 1)
    report = event.close()
    assert report.complete, report
    return report.path


def test_it_has_what_was_in_force_what_came_before_and_after_and_why_it_was_kept(tmp_path):
    path = written(tmp_path)
    bag = open_bag(path)
    first = next(bag.messages())
    assert (first.topic, first.data) == ('/state', encode_string('1 0'))
    # When it was published is not made up.
    assert (first.publish_ns, first.log_ns) == (START, START + 3999 * MS)
    assert [m.data for _, m in bag.decoded('/stream')] == [f'0 {k}' for k in range(3999, 5100)]
    events = events_of(bag.metadata)
    assert events == [
        Event(FAULT, START + 4999 * MS, REASON),
        Event(MARK, START + 5001 * MS, 'seen by the operator'),
    ]
    cut(path, tmp_path / 'part', 0.1, 0.2)
    assert events_of(open_bag(tmp_path / 'part').metadata) == events[:1]


def test_what_waits_is_written_a_little_at_a_time(tmp_path):
    event = EventBag(filled(), MARK, START + 5000 * MS, 'here')
    event.begin(session_in(tmp_path, MARK))
    turns = 0
    while not event.caught_up:
        before = sum(event.session.report().counts.values())
        event.arrive(b'', 0)
        assert 0 < sum(event.session.report().counts.values()) - before <= 41
        turns += 1
    assert turns == pytest.approx(1002 / 40, abs=2)
    event.close()


def test_one_that_was_cut_off_has_its_reason_and_can_be_recovered(tmp_path):
    path = written(tmp_path)
    (path / 'metadata.yaml').unlink()
    [file] = path.glob('*.mcap')
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    recover(path, tmp_path / 'saved')
    saved = open_bag(tmp_path / 'saved')
    assert events_of(saved.metadata) == [Event(FAULT, START + 4999 * MS, REASON)]
    assert next(saved.messages()).topic == '/state'
    [entry] = [entry for entry in bags_in(tmp_path) if entry.name == path.name]
    assert (entry.kind, entry.events[0].reason) == (FAULT, REASON)
    assert 'endoscope bag recover' in entry.trouble


def test_no_more_are_written_than_may_be_and_none_is_deleted(tmp_path):
    for _ in range(3):
        new_event_bag(tmp_path, FAULT, 3).mkdir()
    (tmp_path / 'recording-20260101-000000').mkdir()
    there = event_bags(tmp_path)
    assert len(there) == 3
    with pytest.raises(BagError, match=r'has 3 bags of faults and marks already: read them'):
        new_event_bag(tmp_path, MARK, 3)
    assert event_bags(tmp_path) == there


@pytest.mark.parametrize(
    'text', ['', 'fault', 'fault at never UTC: x', 'crash at 2026-01-01 UTC: x', 'fault at 9' * 99]
)
def test_what_is_no_event_is_none(text):
    assert event_from_text(text) is None
