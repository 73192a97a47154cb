"""The summary of a file says what the file holds, or is not believed."""

import numpy as np
import pytest
from mcap.writer import Writer

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr import encode_string
from endoscope_bags.listing import bags_in
from endoscope_bags.mcap_records import read_summary
from endoscope_bags.message_types import STRING

START, MS = 1_790_000_000 * 10**9, 10**6
RECORDS = {'endoscope_event': {'fault': 'fault at 2026-09-21T14:13:20 UTC: a reason'}}


@pytest.fixture
def file(tmp_path):
    path = tmp_path / 'bag.mcap'
    with BagWriter(path, chunk_seconds=0.1, records=RECORDS) as writer:
        for k in range(1000):
            at = START + k * MS
            writer.write_raw('/stream', STRING, encode_string(f'{k}'), at, at, k + 1)
    return path


def test_it_says_what_the_file_holds(file):
    bag, summary = open_bag(file), read_summary(file)
    assert (summary.start_ns, summary.end_ns) == (bag.start_ns, bag.end_ns)
    assert summary.metadata == bag.metadata


def test_of_a_file_that_was_cut_off_there_is_none(file):
    data = file.read_bytes()
    for length in (0, 7, 8, 40, len(data) // 2, len(data) - 9, len(data) - 1):
        file.write_bytes(data[:length])
        assert read_summary(file) is None


def test_one_that_was_changed_is_not_believed(file):
    data = file.read_bytes()
    begin = int.from_bytes(data[-28:-20], 'little')
    for place in np.random.default_rng(1).integers(begin, len(data), 200):
        changed = bytearray(data)
        changed[place] ^= 0x10
        file.write_bytes(changed)
        assert read_summary(file) is None


def test_metadata_that_are_not_where_it_says_are_not_believed(file):
    data = file.read_bytes()
    for place in np.random.default_rng(2).integers(8, 60, 50):
        changed = bytearray(data)
        changed[place] ^= 0xFF
        file.write_bytes(changed)
        # A changed letter of a name or a value goes unnoticed, and nothing else does.
        summary = read_summary(file)
        assert summary is None or summary.end_ns == START + 999 * MS


@pytest.mark.parametrize(
    ('options', 'is_read'),
    [({}, True), ({'use_statistics': False}, False), ({'use_summary_offsets': False}, True)],
)
def test_files_of_the_library_are_read_as_far_as_they_have_a_summary(tmp_path, options, is_read):
    path = tmp_path / 'other.mcap'
    with path.open('wb') as stream:
        writer = Writer(stream, **options)
        writer.start('ros2', 'another')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data')
        channel = writer.register_channel('/stream', 'cdr', schema)
        writer.add_metadata('note', {'text': 'so'})
        for k in range(3):
            writer.add_message(channel, START + k, encode_string('x'), START + k)
        writer.finish()
    summary = read_summary(path)
    assert (summary is not None) == is_read
    if summary is not None:
        assert (summary.start_ns, summary.end_ns) == (START, START + 2)
        assert summary.metadata == {'note': {'text': 'so'}}


def test_a_listing_reads_no_messages_of_what_is_whole(file):
    [whole] = bags_in(file.parent)
    data = bytearray(file.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 100] = bytes(100)
    file.write_bytes(data)
    assert bags_in(file.parent) == [whole]
    assert whole.kind == 'fault'
    file.write_bytes(data[: len(data) - 20])
    [cut] = bags_in(file.parent)
    assert cut.kind == 'fault'
    assert 'endoscope bag recover' in cut.trouble
