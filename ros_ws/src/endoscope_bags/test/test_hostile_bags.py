"""Crafted and damaged recordings: one line or a right answer, and all that is whole is saved."""

import struct
import zlib

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType, Writer

from endoscope_bags import BagError, BagWriter, open_bag
from endoscope_bags.cdr_encoding import encode_joint_state, encode_string
from endoscope_bags.copying import recover
from endoscope_bags.errors import MalformedMessageError
from endoscope_bags.information import bag_information
from endoscope_bags.mcap_records import MAGIC
from endoscope_bags.message_types import JOINT_STATE, STRING
from endoscope_bags.unpacking import LARGEST_CHUNK

MS = 10**6
N = 400
CHUNK, CHANNEL, MESSAGE, DATA_END, FOOTER = 6, 4, 5, 15, 2


def sound(path):
    with BagWriter(path, chunk_seconds=0.02) as writer:
        for k in range(N):
            data = encode_joint_state(['bend_x'], k * MS, position=[k])
            writer.write_raw('/rig/slave/servo_jp', JOINT_STATE, data, k * MS, k * MS, k + 1)
    return path.read_bytes()


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


def one_line(path, what):
    with pytest.raises(BagError, match=what) as caught:
        bag_information(open_bag(path))
    assert str(caught.value).isprintable()
    assert path.name in str(caught.value)


@pytest.fixture
def path(tmp_path):
    return tmp_path / 'case.mcap'


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    return sound(tmp_path_factory.mktemp('whole') / 'whole.mcap')


def replaced(whole, opcode, change):
    """The recording with the first record of a kind changed."""
    records = records_of(whole)
    k = next(k for k, record in enumerate(records) if record[0] == opcode)
    records[k] = (opcode, change(records[k][1]))
    return bag_of(records)


@pytest.mark.parametrize('size', [2**34, 2**62, 2**63, 2**64 - 1, LARGEST_CHUNK + 1])
def test_a_chunk_may_not_claim_more_than_recorders_write(path, tmp_path, whole, size):
    path.write_bytes(replaced(whole, CHUNK, lambda b: b[:16] + struct.pack('<Q', size) + b[24:]))
    one_line(path, f'it claims {size} bytes')
    assert recover(path, tmp_path / 'out').message_count == N - 20


@pytest.mark.parametrize('size', [2**31, 2**62, 2**63, 2**64 - 1])
def test_data_of_a_chunk_may_not_claim_more_than_the_record(path, tmp_path, whole, size):
    path.write_bytes(replaced(whole, CHUNK, lambda b: b[:36] + struct.pack('<Q', size) + b[44:]))
    one_line(path, 'do not end where it ends')
    assert recover(path, tmp_path / 'out').message_count == N - 20


@pytest.mark.parametrize('declared', [1 << 34, 1 << 10])
def test_a_zstd_frame_may_not_lie_about_its_size(path, tmp_path, whole, declared):
    packed = bytearray(zstandard.ZstdCompressor(write_content_size=True).compress(bytes(1 << 20)))
    # Magic, descriptor (single segment, 4 bytes of size), size.
    assert packed[4] >> 6 == 2
    packed[5:9] = struct.pack('<I', declared % 2**32)
    path.write_bytes(replaced(whole, CHUNK, lambda _: chunk(bytes(packed), 1 << 20)))
    one_line(path, 'chunk 1 .* is damaged')
    assert recover(path, tmp_path / 'out').message_count == N - 20


def bomb(name):
    packer = zstandard.ZstdCompressor().compressobj()
    piece = bytes(1 << 20)
    if name == b'zstd':
        return b''.join(packer.compress(piece) for _ in range(1 << 10)) + packer.flush()
    with lz4.frame.LZ4FrameCompressor() as frame:
        body = frame.begin() + b''.join(frame.compress(piece) for _ in range(1 << 8))
        return body + frame.flush()


@pytest.mark.parametrize('name', [b'zstd', b'lz4'])
@pytest.mark.parametrize('honest', [True, False])
def test_few_bytes_do_not_become_gigabytes(path, tmp_path, whole, name, honest):
    packed, size = bomb(name), 1 << (30 if name == b'zstd' else 28)
    body = chunk(packed, size if honest else 1000, name)
    path.write_bytes(replaced(whole, CHUNK, lambda _: body))
    one_line(path, 'it claims' if honest else 'it does not hold the 1000 bytes')
    assert recover(path, tmp_path / 'out').message_count == N - 20


def test_many_chunks_do_not_become_gigabytes_either(path, whole):
    note = built([(MESSAGE, struct.pack('<HIQQ', 1, 1, 1, 1) + bytes(1000))])
    records = note * (LARGEST_CHUNK // len(note))
    body = chunk(zstandard.compress(records), len(records))
    parts = records_of(whole)
    k = next(k for k, record in enumerate(parts) if record[0] == CHUNK)
    path.write_bytes(bag_of([*parts[:k], *[(CHUNK, body)] * 10, *parts[k:]]))
    assert path.stat().st_size < 1 << 20
    one_line(path, 'more than any recorder puts in such a file')


def test_the_shortest_messages_are_counted_too(path, whole):
    note = built([(MESSAGE, struct.pack('<HIQQ', 1, 1, 1, 1))])
    records = note * (1 << 20)
    path.write_bytes(
        replaced(whole, CHUNK, lambda _: chunk(zstandard.compress(records), len(records)))
    )
    one_line(path, 'more than any recorder puts in such a file')


@pytest.mark.parametrize('length', [0, 1, 3])
def test_a_data_end_that_is_too_short(path, tmp_path, whole, length):
    records = [(o, bytes(length) if o == DATA_END else b) for o, b in records_of(whole)]
    path.write_bytes(MAGIC + built(records) + MAGIC)
    one_line(path, 'dataend|data_end')
    assert recover(path, tmp_path / 'out').message_count == N


def test_times_that_no_clock_shows_are_left_out(path, tmp_path, whole):
    def late(body):
        records = bytearray(zstandard.decompress(body[44:]))
        struct.pack_into('<Q', records, 9 + 6, 2**63)
        return chunk(zstandard.compress(records), len(records), crc=zlib.crc32(records))

    path.write_bytes(replaced(whole, CHUNK, late))
    one_line(path, '1 messages of impossible times')
    assert recover(path, tmp_path / 'out').message_count == N - 1


def test_messages_of_no_channel_are_said(path, whole):
    records = [record for record in records_of(whole) if record[0] != CHANNEL]
    path.write_bytes(bag_of(records))
    one_line(path, f'{N} messages of no channel')


def test_a_channel_is_described_once(path, whole):
    records = records_of(whole)
    k = next(k for k, record in enumerate(records) if record[0] == CHANNEL)
    records.insert(k + 1, (CHANNEL, records[k][1].replace(b'servo_jp', b'servo_jx')))
    path.write_bytes(bag_of(records))
    one_line(path, 'another description of the same id')


@pytest.mark.parametrize(
    'text', ['- 1', 'a: [', 'history: 1', '- depth: x', '- history: [1]', '9' * 5000, '[' * 9000]
)
def test_quality_of_service_that_is_none(path, tmp_path, text):
    with path.open('wb') as file:
        writer = Writer(file)
        writer.start(profile='ros2', library='other')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data')
        qos = {'offered_qos_profiles': text}
        channel = writer.register_channel('/note', 'cdr', schema, qos)
        writer.add_message(channel, 1, encode_string('x'), 1)
        writer.finish()
    one_line(path, 'topic /note: the quality of service')
    report = recover(path, tmp_path / 'out')
    assert report.message_count == 1
    assert 'quality of service' in str(report)


def test_names_do_not_steer_a_terminal(path, tmp_path):
    evil = '/a\x1b[2J\x1b]0;owned\x07\n/b\u202e'
    with BagWriter(path) as writer:
        writer.write_raw(evil, STRING, encode_string('x'), 1)
        writer.close({'note\x1b[1m': '\x9b31m'})
    shown = str(bag_information(open_bag(path)))
    saved = str(recover(path, tmp_path / 'out'))
    for text in (shown, saved):
        assert r'/a\x1b[2J\x1b]0;owned\x07\n/b\u202e' in text
        assert all(line.isprintable() for line in text.splitlines())
    with pytest.raises(BagError) as caught:
        open_bag(path).find('other')
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ('old', 'new', 'what'),
    [
        ('- bag_0.mcap', '- 5', 'has to list names'),
        ('- bag_0.mcap', '- bag_0.mcap\n  - bag_0.mcap', 'lists a file twice'),
        ('- bag_0.mcap', '- ' + 'n' * 5000, 'nnn'),
        ('- bag_0.mcap', '- "\\0"', 'missing'),
        ('relative_file_paths:\n  - bag_0.mcap', 'relative_file_paths: 5', 'has to list names'),
        ("compression_mode: ''", 'compression_mode: 5\n  x: 2026-13-01', 'month must be in 1..12'),
        ("compression_mode: ''", 'compression_mode: [FILE]', 'compression mode'),
        ('storage_identifier: mcap', 'storage_identifier: 7', 'storage 7'),
        ('version: 9', 'version: ' + '9' * 5000, 'a number of 5000 characters'),
        ('version: 9', 'version: ' + '[' * 5000, 'nested deeper'),
        ('version: 9', 'version: 9\n  version: 10', "key 'version' is given twice"),
        ('version: 9', 'version: &v 9\n  again: *v', 'refers to another place'),
    ],
)
def test_metadata_that_cannot_be(tmp_path, old, new, what):
    folder = tmp_path / 'bag'
    with BagWriter(folder) as writer:
        writer.write_raw('/a', STRING, encode_string('x'), 1)
    metadata = folder / 'metadata.yaml'
    text = metadata.read_text()
    assert old in text
    metadata.write_text(text.replace(old, new, 1))
    with pytest.raises(BagError, match=what) as caught:
        open_bag(folder)
    assert str(caught.value).isprintable()


def test_a_note_of_losses_that_is_no_number_stays_a_note(path):
    with BagWriter(path) as writer:
        writer.write_raw('/a', STRING, encode_string('x'), 1)
        writer.close({'lost /a': '9' * 5000, 'lost /b': 'many'})
    information = bag_information(open_bag(path))
    assert set(information.notes) == {'lost /a', 'lost /b'}


def test_joints_that_every_message_names_anew_are_refused(path):
    with BagWriter(path) as writer:
        for k in range(1100):
            data = encode_joint_state([f'joint_{k}'], k, position=[0.0])
            writer.write_raw('/a', JOINT_STATE, data, k)
    with pytest.raises(MalformedMessageError, match='1100 joints in 1100 messages'):
        open_bag(path).joint_state('/a')


@pytest.mark.parametrize('seed', range(25))
def test_200_random_bytes_cost_the_chunks_that_they_hit(path, tmp_path, whole, seed):
    """Also where a length is hit, after which the next record is not where it says."""
    damaged = bytearray(whole)
    first = whole.index(b'zstd') - 45
    places = np.random.default_rng(seed).integers(first, len(whole) * 3 // 4, size=200 - 8 * seed)
    for place in places:
        damaged[place] ^= 0xA5
    path.write_bytes(damaged)
    position, due = len(MAGIC), 0
    for opcode, body in records_of(whole):
        stop = position + 9 + len(body)
        hit = ((places >= position) & (places < stop)).any()
        due += 20 * (opcode == CHUNK and not hit)
        position = stop
    saved = recover(path, tmp_path / 'out')
    assert saved.message_count >= due > 0
    series = open_bag(tmp_path / 'out').joint_state('slave/servo_jp')
    np.testing.assert_array_equal(series.position[:, 0] * MS, series.stamp_ns)


@pytest.mark.parametrize('opcode', [CHUNK, 3, CHANNEL, 7, 8, 12])
@pytest.mark.parametrize('length', [0, 7, 2**16, 2**34, 2**63])
def test_a_length_that_lies_costs_its_record_only(path, tmp_path, whole, opcode, length):
    damaged, position = bytearray(whole), len(MAGIC)
    for kind, body in records_of(whole):
        if kind == opcode:
            break
        position += 9 + len(body)
    struct.pack_into('<Q', damaged, position + 1, length)
    path.write_bytes(damaged)
    one_line(path, '.')
    assert recover(path, tmp_path / 'out').message_count >= N - 20 * (opcode in (CHUNK, 7))


def test_messages_outside_chunks_are_found_again_behind_a_gap(path, tmp_path):
    with path.open('wb') as file:
        writer = Writer(file, use_chunking=False, compression=CompressionType.NONE)
        writer.start(profile='ros2', library='other')
        schema = writer.register_schema(STRING, 'ros2msg', b'string data')
        channel = writer.register_channel('/note', 'cdr', schema)
        for k in range(100):
            writer.add_message(channel, k, encode_string(f'note {k}'), k)
        writer.finish()
    data = bytearray(path.read_bytes())
    place = data.index(b'note 50') - 39
    data[place : place + 20] = bytes(20)
    path.write_bytes(data)
    one_line(path, 'ends in the middle')
    assert recover(path, tmp_path / 'out').message_count == 99


def test_the_first_bytes_are_no_reason_to_lose_the_rest(path, tmp_path, whole):
    path.write_bytes(bytes(8) + whole[8:])
    with pytest.raises(BagError):
        open_bag(path)
    assert recover(path, tmp_path / 'out').message_count == N


@pytest.mark.parametrize('k', range(0, 100, 7))
def test_a_flipped_byte_of_the_summary_is_noticed(path, whole, k):
    summary = len(whole) - 8 - 29 - 400
    damaged = bytearray(whole)
    damaged[summary + k] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(BagError):
        open_bag(path)
