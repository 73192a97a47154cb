"""The recorder without ROS: losses, a full disk, simulated time."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest

from endoscope_bags import open_bag
from endoscope_bags.bag_writer import CHUNK_SECONDS
from endoscope_bags.cdr import encode_string
from endoscope_bags.information import bag_information
from endoscope_bags.message_types import STRING
from endoscope_bags.recording_session import Arrival, RecordingSession, simulated_receipt_ns
from endoscope_bags.topic import SENSOR_QOS

MS = 10**6


def arrivals(topic, numbers, text='x' * 40):
    return [Arrival(k * MS, topic, k + 1, k * MS, encode_string(text)) for k in numbers]


def test_losses_are_counted_and_written_down(tmp_path):
    session = RecordingSession(tmp_path / 'bag')
    topic = session.add_topic('/a', STRING, lambda: [SENSOR_QOS])
    session.add_topic('/silent', STRING)
    for k in range(0, 1000, 5):
        session.accept(arrivals(topic, [n for n in range(k, k + 5) if n not in (7, 8, 900)]))
    report = session.close()
    assert report.counts == {'/a': 997, '/silent': 0}
    assert report.lost == {'/a': 3, '/silent': 0}
    assert not report.complete
    assert '997 messages, 3 lost (/a 3)' in str(report)
    bag = open_bag(tmp_path / 'bag')
    assert bag.message_count == 997
    assert bag.topics['/a'].qos == (SENSOR_QOS,)
    assert bag.metadata['endoscope_bags'] == {
        'ended': 'on request',
        'lost /a': '3',
        'lost /silent': '0',
    }
    assert 'lost /a: ' in (tmp_path / 'bag' / 'metadata.yaml').read_text()
    assert [t.lost for t in bag_information(bag).topics] == [3, 0]


def test_a_batch_is_sorted_over_its_topics(tmp_path):
    session = RecordingSession(tmp_path / 'bag', threaded=False)
    a, b = session.add_topic('/a', STRING), session.add_topic('/b', STRING)
    session.accept(arrivals(b, [0, 2, 4]) + arrivals(a, [1, 3]))
    assert session.close().message_count == 5
    topics = [message.topic for message in open_bag(tmp_path / 'bag').messages()]
    assert topics == ['/b', '/a', '/b', '/a', '/b']


def test_what_waits_too_long_is_handed_over(tmp_path):
    session = RecordingSession(tmp_path / 'bag', threaded=False)
    session.accept(arrivals(session.add_topic('/a', STRING), [0]))
    session.flush_stale(round(CHUNK_SECONDS * 1e9))
    file = tmp_path / 'bag' / 'bag_0.mcap'
    empty = file.stat().st_size
    session.flush_stale(round(1.5e9 * CHUNK_SECONDS))
    assert file.stat().st_size > empty
    assert open_bag(tmp_path / 'bag', salvage=True).message_count == 1
    session.close()


def test_closing_twice_gives_the_same_report(tmp_path):
    session = RecordingSession(tmp_path / 'bag')
    session.accept(arrivals(session.add_topic('/a', STRING), range(10)))
    assert session.close() == session.close()


FULL = """
    import resource, sys
    import numpy as np
    from endoscope_bags.recording_session import Arrival, RecordingSession
    path, limit, threaded = sys.argv[1], int(sys.argv[2]), sys.argv[3] == 'threaded'
    count = int(sys.argv[4])
    if limit:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    session = RecordingSession(path, threaded=threaded)
    topic = session.add_topic('/a', 'std_msgs/msg/String')
    noise = np.random.default_rng(0)
    arrivals = [
        Arrival(n * 10**6, topic, n + 1, n * 10**6, noise.bytes(400)) for n in range(count)
    ]
    for k in range(0, count, 5):
        session.accept(arrivals[k : k + 5])
    report = session.close()
    print(report.message_count, report.lost_count, report.complete, report.finished)
    print(report)
"""


def fill(path, limit, threaded, count):
    done = subprocess.run(
        [sys.executable, '-c', textwrap.dedent(FULL), str(path), str(limit), threaded, str(count)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    recorded, lost, complete, finished = first.split()
    return int(recorded), int(lost), complete, finished, second


# A writing thread has up to 16 chunks, of 250 messages here, before it: it finds the disk full on
# closing in the short recording, and while it is made in the long one.
@pytest.mark.parametrize('count', [4000, 8000])
@pytest.mark.parametrize('threaded', ['threaded', 'inline'])
def test_a_full_disk_keeps_what_is_there_and_is_reported(tmp_path, threaded, count):
    recorded, lost, complete, finished, text = fill(tmp_path / 'bag', 700_000, threaded, count)
    assert recorded + lost == count
    assert 500 < recorded < 2000
    assert (complete, finished) == ('False', 'True')
    assert 'File too large; recording ended there' in text
    bag = open_bag(tmp_path / 'bag')
    assert bag.message_count == recorded
    np.testing.assert_array_equal(bag.times('/a').log_ns, np.arange(recorded) * MS)
    assert 'File too large' in bag_information(bag).notes['ended']


def test_the_limit_is_what_stopped_it(tmp_path):
    recorded, lost, complete, *_ = fill(tmp_path / 'bag', 0, 'threaded', 4000)
    assert (recorded, lost, complete) == (4000, 0, 'True')


def test_no_room_at_all_is_an_error_that_leaves_nothing(tmp_path):
    code = f"""
        import resource
        from endoscope_bags.recording_session import RecordingSession
        from endoscope_bags.errors import BagWriteError
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, resource.RLIM_INFINITY))
        try:
            RecordingSession({str(tmp_path / 'bag')!r})
        except BagWriteError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, '-c', textwrap.dedent(code)], capture_output=True, text=True, check=True
    )
    assert 'File too large' in done.stdout
    assert list(tmp_path.iterdir()) == []


def test_simulated_receipt():
    assert simulated_receipt_ns(None, 5 * MS, 6 * MS) == 5 * MS
    assert simulated_receipt_ns(5 * MS, 5 * MS, 6 * MS) == 5 * MS
    assert simulated_receipt_ns(6 * MS, 5 * MS, 6 * MS) == 6 * MS
    assert simulated_receipt_ns(2 * MS, 5 * MS, 6 * MS) == 5 * MS
    assert simulated_receipt_ns(99 * MS, 5 * MS, 6 * MS) == 6 * MS
    assert simulated_receipt_ns(3 * MS, 0, 6 * MS) == 6 * MS
