"""Recordings built by hand to do harm: one line, little memory, and what is whole is saved."""

import shutil
import struct
import subprocess
import sys
import zlib

import lz4.frame
import pytest
import zstandard
from counted_bag import N, says_one_line, write_bag
from mcap.writer import Writer

from endoscope_bags import BagError, BagWriter, open_bag
from endoscope_bags.cdr import encode_joint_state, encode_string
from endoscope_bags.copying import recover
from endoscope_bags.errors import MalformedMessageError
from endoscope_bags.information import bag_information
from endoscope_bags.mcap_records import LARGEST_CHUNK, MAGIC
from endoscope_bags.message_types import JOINT_STATE, STRING
from endoscope_bringup.cli import main

CHUNK, CHANNEL, MESSAGE, DATA_END, FOOTER = 6, 4, 5, 15, 2


def records_of(data):
    position, found = len(MAGIC), []
    while data[position:] != MAGIC:
        opcode, length = struct.unpack_from('<BQ', data, position)
        found.append((opcode, data[position + 9 : position + 9 + length]))
        position += 9 + length
    return found


def built(records):
    return b''.join(struct.pack('<BQ', opcode, len(body)) + body for opcode, body in records)


def bag_of(records):
    """A recording without checksums around its records."""
    plain = {DATA_END: bytes(4), FOOTER: bytes(20)}
    return MAGIC + built([(o, plain.get(o, b)) for o, b in records if o not in (8, 11)]) + MAGIC


def chunk(packed, size, name=b'zstd', crc=0):
    head = struct.pack('<QQQII', 0, 0, size, crc, len(name))
    return head + name + struct.pack('<Q', len(packed)) + packed


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    return write_bag(tmp_path_factory.mktemp('whole') / 'whole.mcap').read_bytes()


@pytest.fixture
def path(tmp_path):
    return tmp_path / 'case.mcap'


def replaced(whole, opcode, change):
    """The recording with the first record of a kind changed."""
    records = records_of(whole)
    k = next(k for k, record in enumerate(records) if record[0] == opcode)
    records[k] = (opcode, change(records[k][1]))
    return bag_of(records)


def one_line(path, what, saved=None):
    """The recording is refused in one line, and so many messages are saved of it."""
    with pytest.raises(BagError, match=what) as caught:
        bag_information(open_bag(path))
    says_one_line(caught.value)
    assert path.name in str(caught.value)
    if saved is not None:
        assert recover(path, path.parent / 'out').message_count == saved
        shutil.rmtree(path.parent / 'out')


def test_a_chunk_may_not_claim_more_than_it_holds_or_recorders_write(path, whole):
    for size in (2**34, 2**63, 2**64 - 1, LARGEST_CHUNK + 1):
        claim = struct.pack('<Q', size)
        path.write_bytes(replaced(whole, CHUNK, lambda b, c=claim: b[:16] + c + b[24:]))
        one_line(path, f'it claims {size} bytes', N - 20)
    for size in (2**31, 2**64 - 1):
        claim = struct.pack('<Q', size)
        path.write_bytes(replaced(whole, CHUNK, lambda b, c=claim: b[:36] + c + b[44:]))
        one_line(path, 'do not end where it ends', N - 20)


def test_a_zstd_frame_may_not_lie_about_its_size(path, whole):
    packed = bytearray(zstandard.ZstdCompressor(write_content_size=True).compress(bytes(1 << 20)))
    # Magic, descriptor (single segment, 4 bytes of size), size.
    assert packed[4] >> 6 == 2
    for declared in (0, 1 << 10):
        packed[5:9] = struct.pack('<I', declared)
        path.write_bytes(replaced(whole, CHUNK, lambda _: chunk(bytes(packed), 1 << 20)))
        one_line(path, 'chunk 1 .* is damaged', N - 20)


# Set in a shell: beside threads a process must not be forked to set it.
SMALL = 'ulimit -v 2000000; exec "$@"'


def test_few_bytes_do_not_become_gigabytes(path, whole):
    piece, packer = bytes(1 << 20), zstandard.ZstdCompressor().compressobj()
    zstd = b''.join(packer.compress(piece) for _ in range(1 << 11)) + packer.flush()
    with lz4.frame.LZ4FrameCompressor() as frame:
        lz4s = frame.begin() + b''.join(frame.compress(piece) for _ in range(1 << 8))
        lz4s += frame.flush()
    for name, packed, size in ((b'zstd', zstd, 1 << 31), (b'lz4', lz4s, 1 << 28)):
        for claimed, what in ((1000, 'it does not hold the 1000 bytes'), (size, 'it claims')):
            body = chunk(packed, claimed, name)
            path.write_bytes(replaced(whole, CHUNK, lambda _, b=body: b))
            one_line(path, what, N - 20)
    # Two gigabytes, honestly declared, in less than 100 kB.
    path.write_bytes(replaced(whole, CHUNK, lambda _: chunk(zstd, 1 << 31)))
    assert path.stat().st_size - len(whole) < 100_000
    program = [sys.executable, '-m', 'endoscope_bringup.cli', 'bag', 'info', str(path)]
    done = subprocess.run(
        ['sh', '-c', SMALL, 'sh', *program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert 'it claims 2147483648 bytes' in line


@pytest.mark.parametrize(('size', 'times'), [(1000, 10), (0, 1)])
def test_many_chunks_and_the_shortest_messages_do_not_either(path, whole, size, times):
    note = built([(MESSAGE, struct.pack('<HIQQ', 1, 1, 1, 1) + bytes(size))])
    records = note * (LARGEST_CHUNK // len(note) if size else 1 << 20)
    body = chunk(zstandard.compress(records), len(records))
    parts = records_of(whole)
    k = next(k for k, record in enumerate(parts) if record[0] == CHUNK)
    path.write_bytes(bag_of([*parts[:k], *[(CHUNK, body)] * times, *parts[k:]]))
    assert path.stat().st_size < 1 << 20
    one_line(path, 'more than any recorder puts in such a file')


def test_records_that_cannot_be_are_refused_and_what_is_whole_is_saved(path, whole):
    def late(body):
        records = bytearray(zstandard.decompress(body[44:]))
        struct.pack_into('<Q', records, 9 + 6, 2**63)
        return chunk(zstandard.compress(records), len(records), crc=zlib.crc32(records))

    path.write_bytes(replaced(whole, CHUNK, late))
    one_line(path, '1 messages of impossible times', N - 1)
    records = records_of(whole)
    path.write_bytes(
        MAGIC + built([(o, b'\0' if o == DATA_END else b) for o, b in records]) + MAGIC
    )
    one_line(path, 'dataend|data_end', N)
    wrong = struct.pack('<I', 12345)
    path.write_bytes(
        MAGIC + built([(o, wrong if o == DATA_END else b) for o, b in records]) + MAGIC
    )
    one_line(path, 'the data do not agree with their checksum', N)
    path.write_bytes(bag_of([record for record in records if record[0] != CHANNEL]))
    one_line(path, f'{N} messages of no channel')
    k = next(k for k, record in enumerate(records) if record[0] == CHANNEL)
    records.insert(k + 1, (CHANNEL, records[k][1].replace(b'servo_jp', b'servo_jx')))
    path.write_bytes(bag_of(records))
    one_line(path, 'another description of the same id')


def test_what_lies_before_a_length_that_lies_is_saved(path, whole):
    records = records_of(whole)
    third = [k for k, record in enumerate(records) if record[0] == CHUNK][2]
    place = len(MAGIC) + len(built(records[:third])) + 1
    for length in (0, 7, 2**16, 2**34, 2**63):
        path.write_bytes(whole[:place] + struct.pack('<Q', length) + whole[place + 8 :])
        one_line(path, '.', 2 * 20)


@pytest.mark.parametrize('text', ['- 1', 'history: 1', '- depth: x', '[' * 9000])
def test_quality_of_service_that_is_none(path, tmp_path, text):
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start(profile='ros2', library='other')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data')
        channel = writer.register_channel('/note', 'cdr', schema, {'offered_qos_profiles': text})
        writer.add_message(channel, 1, encode_string('x'), 1)
        writer.finish()
    one_line(path, 'topic /note: the quality of service', 1)


def test_names_do_not_steer_a_terminal(path, tmp_path, capsys):
    evil = '/a\x1b[2J\x1b]0;owned\x07\n/b\u202e'
    with BagWriter(path) as writer:
        writer.write_raw(evil, STRING, encode_string('x'), 1)
        writer.close({'note\x1b[1m': '\x9b31m', 'lost /a': '9' * 5000, 'lost /b': 'many'})
    for argv in (['info', str(path)], ['recover', str(path), str(tmp_path / 'out')]):
        assert main(['bag', *argv]) == 0
        shown = capsys.readouterr().out
        assert r'/a\x1b[2J\x1b]0;owned\x07\n/b\u202e' in shown
        assert all(line.isprintable() for line in shown.splitlines())
    recording = open_bag(path)
    # A note of losses that is no number stays a note.
    assert {'lost /a', 'lost /b'} < set(bag_information(recording).notes)
    with pytest.raises(BagError) as caught:
        recording.find('other')
    says_one_line(caught.value)


@pytest.mark.parametrize(
    ('old', 'new', 'what'),
    [
        ('- bag_0.mcap', '- bag_0.mcap\n  - bag_0.mcap', 'lists a file twice'),
        ('- bag_0.mcap', '- "\\0"', 'missing'),
        ('relative_file_paths:\n  - bag_0.mcap', 'relative_file_paths: 5', 'has to list names'),
        ('storage_identifier: mcap', 'storage_identifier: 7', 'storage 7'),
    ],
)
def test_metadata_that_cannot_be(tmp_path, old, new, what):
    metadata = write_bag(tmp_path / 'bag') / 'metadata.yaml'
    text = metadata.read_text()
    assert old in text
    metadata.write_text(text.replace(old, new, 1))
    with pytest.raises(BagError, match=what):
        open_bag(tmp_path / 'bag')


def test_joints_that_every_message_names_anew_are_refused(path):
    with BagWriter(path) as writer:
        for k in range(1100):
            data = encode_joint_state([f'joint_{k}'], k, position=[0.0])
            writer.write_raw('/a', JOINT_STATE, data, k)
    with pytest.raises(MalformedMessageError, match='1100 joints in 1100 messages'):
        open_bag(path).joint_state('/a')


# Set in a shell: beside threads a process must not be forked to set it.
SMALL = 'ulimit -v 2000000; exec "$@"'
