"""What the recorder wrote, read by programs that are not ours: rosbags, and Foxglove's decoders."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from doc_pages import WORKSPACE
from recorded_session import (
    CLUTCH,
    SERVO,
    SESSION,
    STATE,
    TRACKER,
    TRANSFORMS,
    WIRES,
    N,
    record_all_types,
)
from rosbags.highlevel import AnyReader

from endoscope_bags import open_bag
from endoscope_bags.message_types import message_type
from endoscope_nodes.topics import BY_NAME, TOPICS

pytestmark = pytest.mark.nightly

LAYOUT = WORKSPACE / 'src/endoscope_bringup/layouts/foxglove.json'
PATHS = [
    (BY_NAME[topic if topic in BY_NAME else topic.removeprefix('/endoscope/')].type, fields)
    for value in re.findall(r'"value": "(/[^"]+)"', LAYOUT.read_text())
    for topic, _, fields in [value.partition('.')]
]
"""Type and fields of every path that the layout plots."""
READERS = Path(__file__).parent / 'independent_readers'


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp('independent') / 'bag'
    sent, report = record_all_types(path)
    assert report.complete, report
    return sent, path


@pytest.fixture(scope='module')
def foxglove(recorded, tmp_path_factory):
    """What Foxglove's packages say of the recording."""
    if not shutil.which('npm') or not shutil.which('node'):
        pytest.skip("Foxglove's readers need node and npm, which are not installed")
    folder = tmp_path_factory.mktemp('node')
    for file in READERS.iterdir():
        if file.is_file():
            shutil.copy(file, folder)
    installed = subprocess.run(
        ['npm', 'ci', '--no-progress', '--prefer-offline'],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    if installed.returncode and any(
        word in installed.stderr for word in ('ENOTFOUND', 'ECONN', 'ETIMEDOUT', 'EAI_AGAIN')
    ):
        pytest.skip("Foxglove's readers are fetched from the npm registry, which cannot be reached")
    assert installed.returncode == 0, installed.stderr
    done = subprocess.run(
        ['node', 'read.mjs', str(recorded[1] / 'bag_0.mcap'), json.dumps(PATHS)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_recording_has_every_type_that_is_recorded(recorded):
    recorded_types = {topic.type for topic in TOPICS if topic.recorded}
    assert {t.type for t in open_bag(recorded[1]).topics.values() if t.message_count} == (
        recorded_types
    )


@pytest.mark.parametrize('bare', [False, True])
def test_rosbags_reads_every_message(recorded, bare):
    sent, path = recorded
    with AnyReader([path / 'bag_0.mcap' if bare else path]) as reader:
        messages = {topic: [] for topic in sent}
        for connection, log_ns, raw in reader.messages():
            if connection.topic in messages:
                message = reader.deserialize(raw, connection.msgtype)
                messages[connection.topic].append((log_ns, message))
    assert {t: len(m) for t, m in messages.items()} == {t: len(m) for t, m in sent.items()}
    for (_, message), (stamp, position) in zip(messages[SERVO], sent[SERVO], strict=True):
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp
        assert message.position.tolist() == position
    assert [m.effort.tolist() for _, m in messages[WIRES]] == [e for _, e in sent[WIRES]]
    assert [m.pose.position.x for _, m in messages[TRACKER]] == [p[0] for _, p in sent[TRACKER]]
    assert [m.data for _, m in messages[STATE]] == sent[STATE]
    assert [m.frame_id for _, m in messages[SESSION]] == sent[SESSION]
    assert [log for log, _ in messages[SERVO]] == open_bag(path).times(SERVO).log_ns.tolist()


def test_foxglove_reads_every_message(recorded, foxglove):
    sent, path = recorded
    bag = open_bag(path)
    topics = foxglove['index']['topics']
    assert set(topics) == {t.name for t in bag.topics.values() if t.message_count}
    for name, topic in topics.items():
        times = bag.times(name)
        assert topic['type'] == bag.topics[name].type
        assert (topic['schemaEncoding'], topic['messageEncoding']) == ('ros2msg', 'cdr')
        assert topic['count'] == bag.topics[name].message_count
        assert topic['sequences'] == times.sequence.sum()
        assert topic['metadata']['topic_type_hash'] == message_type(topic['type']).type_hash
        first = topic['first']
        assert first['logTime'] == str(times.log_ns[0])
        assert first['publishTime'] == str(times.publish_ns[0])
        assert topic['last']['logTime'] == str(times.log_ns[-1])
    assert topics[SERVO]['sum'] == np.sum([values for _, values in sent[SERVO]])
    assert topics[WIRES]['sum'] == np.sum([values for _, values in sent[WIRES]])
    last = topics[SERVO]['last']['decoded']
    stamp, position = sent[SERVO][-1]
    assert last['name'] == ['motor_x', 'motor_y']
    assert last['position'] == position
    assert last['header']['stamp']['sec'] * 10**9 + last['header']['stamp']['nanosec'] == stamp
    assert topics[STATE]['first']['decoded'] == {'data': 'ENABLED'}
    assert topics[CLUTCH]['last']['decoded']['buttons'] == [sent[CLUTCH][-1]]
    assert topics[SESSION]['last']['decoded']['frame_id'] == sent[SESSION][-1]
    transforms = topics[TRANSFORMS]['first']['decoded']['transforms']
    assert transforms[0]['header']['frame_id'] == 'endoscope_base'
    assert transforms[-1]['child_frame_id'] == 'endoscope_tip'
    assert topics[TRACKER]['first']['decoded']['header']['frame_id'] == 'base'


def test_foxglove_finds_index_and_checksums_right(recorded, foxglove):
    bag = open_bag(recorded[1])
    header, statistics = foxglove['index']['header'], foxglove['index']['statistics']
    assert header['profile'] == 'ros2'
    assert int(statistics['messageCount']) == bag.message_count
    assert foxglove['index']['compressions'] == ['zstd']
    assert int(statistics['messageStartTime']) == bag.start_ns
    assert int(statistics['messageEndTime']) == bag.end_ns
    stream = foxglove['stream']
    assert stream['done']
    assert stream['counts']['Message'] == bag.message_count >= 2 * N
    assert stream['counts']['Footer'] == 1
    assert stream['counts']['Statistics'] == 1


def test_foxglove_finds_what_the_layout_plots(foxglove):
    led = foxglove['index']['led']
    assert set(led) == {f'{kind}.{fields}' for kind, fields in PATHS}
    assert set(led.values()) <= {'float64', 'string'}
