"""Saving what is sound of a damaged recording."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr import encode_string
from endoscope_bags.copying import recover
from endoscope_bags.errors import BagError, BagNotFoundError
from endoscope_bags.message_types import STRING, MessageType
from endoscope_bags.topic import LATCHED_QOS

MS = 10**6
N = 2000


def write(path, **options):
    with BagWriter(path, chunk_seconds=0.1, **options) as writer:
        writer.add_topic('/a', STRING, [LATCHED_QOS])
        for k in range(N):
            writer.write_raw(
                '/a' if k % 2 else '/b',
                STRING,
                encode_string(str(k)),
                k * MS,
                k * MS + 3,
                k // 2 + 1,
            )
    return path


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    return write(tmp_path_factory.mktemp('whole') / 'whole.mcap').read_bytes()


@given(length=st.integers(0, 10**6))
@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_a_cut_file_keeps_every_chunk_that_is_whole(whole, tmp_path_factory, length):
    folder = tmp_path_factory.mktemp('cut')
    length %= len(whole)
    cut = folder / 'cut.mcap'
    cut.write_bytes(whole[:length])
    try:
        report = recover(cut, folder / 'out')
    except BagError:
        assert not (folder / 'out').exists()
        assert length < 3000
        return
    bag = open_bag(folder / 'out')
    times = [message.log_ns for message in bag.messages()]
    assert times == [k * MS for k in range(len(times))]
    assert len(times) % 100 == 0
    assert len(times) >= N * (length / len(whole)) - 250
    assert report.message_count == len(times)
    assert 'ends in the middle' in str(report)


def test_everything_about_the_messages_is_kept(whole, tmp_path):
    (tmp_path / 'cut.mcap').write_bytes(whole[: len(whole) // 2])
    recover(tmp_path / 'cut.mcap', tmp_path / 'out')
    (tmp_path / 'whole.mcap').write_bytes(whole)
    recovered, original = open_bag(tmp_path / 'out'), open_bag(tmp_path / 'whole.mcap')
    count = recovered.message_count
    assert 0 < count < N
    assert list(recovered.messages()) == list(original.messages())[:count]
    assert recovered.topics['/a'].qos == original.topics['/a'].qos == (LATCHED_QOS,)
    assert recovered.topics['/a'].definition == original.topics['/a'].definition
    assert recovered.metadata['endoscope_bags']['recovered_from'] == 'cut.mcap'


def test_a_damaged_chunk_costs_only_itself(whole, tmp_path):
    data = bytearray(whole)
    data[len(data) // 3] ^= 0xFF
    (tmp_path / 'bad.mcap').write_bytes(data)
    report = recover(tmp_path / 'bad.mcap', tmp_path / 'out.mcap')
    assert report.message_count == N - 100
    assert 'is damaged' in str(report)


def test_a_folder_without_metadata_is_recovered(tmp_path):
    folder = write(tmp_path / 'bag')
    (folder / 'metadata.yaml').unlink()
    report = recover(folder, tmp_path / 'out')
    assert report.message_count == N
    assert 'no damage found' in str(report)


def test_types_that_are_not_installed_are_kept(tmp_path):
    kind = MessageType('our_msgs/msg/Own', 'uint8 x\n', 'RIHS01_00')
    with BagWriter(tmp_path / 'bag') as writer:
        writer.add_topic('/own', kind)
        writer.write_raw('/own', kind.name, b'\0\1\0\0\7', 1)
    recover(tmp_path / 'bag', tmp_path / 'out')
    topic = open_bag(tmp_path / 'out').topics['/own']
    assert (topic.type, topic.definition, topic.type_hash) == (
        kind.name,
        kind.definition,
        kind.type_hash,
    )


def test_nothing_is_left_where_nothing_can_be_saved(tmp_path):
    (tmp_path / 'text').write_text('no bag at all')
    with pytest.raises(BagError):
        recover(tmp_path / 'text', tmp_path / 'out')
    with pytest.raises(BagNotFoundError):
        recover(tmp_path / 'absent', tmp_path / 'out')
    assert [p.name for p in tmp_path.iterdir()] == ['text']
