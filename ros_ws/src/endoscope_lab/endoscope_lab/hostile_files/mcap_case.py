"""Spoiled MCAP recordings, by bytes and by their structure: records, lengths, chunks, texts."""

import shutil
import struct
import zlib
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard
from mcap.writer import CompressionType, Writer
from numpy.random import Generator

from endoscope_bags import BagError, BagWriter, Recording, open_bag
from endoscope_bags.cdr_encoding import encode_joint_states, encode_string
from endoscope_bags.copying import recover
from endoscope_bags.information import bag_information
from endoscope_bags.mcap_records import MAGIC
from endoscope_bags.mcap_scan import UNSURE_NAMES
from endoscope_bags.message_types import JOINT_STATE, STRING
from endoscope_lab.hostile_files.spoiling import (
    EVIL_NAMES,
    EVIL_SCALARS,
    boundary,
    flipped,
    spoiled_bytes,
)

MS = 10**6
_START = 1_790_000_000 * 10**9
_N = 200
_CHUNK, _CHANNEL, _SCHEMA, _MESSAGE, _METADATA, _DATA_END, _FOOTER = 6, 4, 3, 5, 12, 15, 2
_CHUNK_HEAD = struct.Struct('<QQQII')
# Less than what a chunk may hold, and more.
_BOMB_MEGABYTES = (60, 1000)

Record = tuple[int, bytes]
Message = tuple[str, int, bytes]


class McapCase:
    """A recording that is spoiled again for each case, read and recovered."""

    def __init__(self, folder: Path) -> None:
        self._path, self._out = folder / 'case.mcap', folder / 'recovered'
        self._whole = [_of_this_project(folder / 'whole.mcap')]
        self._whole += [
            _of_another_program(folder / 'other.mcap', compression, chunked)
            for compression, chunked in (
                (CompressionType.LZ4, True),
                (CompressionType.NONE, True),
                (CompressionType.NONE, False),
            )
        ]
        (folder / 'case.mcap').write_bytes(self._whole[0])
        self._messages = _stored(open_bag(folder / 'case.mcap'))

    def spoil(self, rng: Generator) -> None:
        self._which = int(rng.integers(len(self._whole)))
        data = self._whole[self._which]
        self._places: list[int] | None = None
        self._as_recorded = rng.random() < 0.5
        if self._as_recorded and rng.random() < 0.6:
            data, self._places = flipped(data, rng)
        elif self._as_recorded:
            data = spoiled_bytes(data, rng)
        else:
            data = _restructured(data, rng)
        self._path.write_bytes(data)

    def read(self) -> bool:
        """Look into it, decode it and recover it; tell whether all that came out is right."""
        try:
            right = self._looked_into()
        except BagError as error:
            refused: BagError | None = error
            right = True
        else:
            refused = None
        right = self._recovered() and right
        if refused is not None and right:
            raise refused
        return right

    def _looked_into(self) -> bool:
        recording = open_bag(self._path)
        str(bag_information(recording)).encode()
        for topic in recording.topics.values():
            if topic.type == JOINT_STATE and topic.message_count:
                recording.joint_state(topic.name, finite=())
        found = _stored(recording)
        return not self._as_recorded or found == self._messages

    def _recovered(self) -> bool:
        try:
            report = recover(self._path, self._out)
        except BagError:
            return not self._due()
        try:
            str(report).encode()
            saved = _stored(open_bag(self._out))
        finally:
            shutil.rmtree(self._out)
        # Outside chunks, or where bytes are moved, nothing tells that a message is another.
        told = self._as_recorded and self._which < len(self._whole) - 1
        due, possible = self._due(), self._messages
        if UNSURE_NAMES in ' '.join(report.damage):
            saved, due, possible = ({('', *m[1:]) for m in some} for some in (saved, due, possible))
        return not told or due <= saved <= possible

    def _due(self) -> set[Message]:
        """Messages of the chunks in which nothing was changed."""
        if self._places is None or self._which == len(self._whole) - 1:
            return set()
        return untouched_messages(self._whole[self._which], self._places)


def untouched_messages(data: bytes, places: Sequence[int]) -> set[Message]:
    """Messages of a sound recording that must survive the change of bytes at some places.

    Behind a record whose length was changed nothing has to be found.
    """
    due: set[Message] = set()
    position = len(MAGIC)
    touched: list[bool] = []
    records = _parsed(data)
    lost = False
    for _, body in records:
        stop = position + 9 + len(body)
        lost = lost or any(position <= place < position + 9 for place in places)
        touched.append(lost or any(position <= place < stop for place in places))
        position = stop
    end = next(k for k, (opcode, _) in enumerate(records) if opcode == _DATA_END)
    described = not any(
        hit for hit, (opcode, _) in zip(touched, records, strict=True) if opcode < _MESSAGE
    )
    if not described or any(touched[end:]):
        return due
    topics = {
        struct.unpack_from('<H', body)[0]: _text(body, 4)
        for opcode, body in _all_records(records)
        if opcode == _CHANNEL
    }
    for hit, (opcode, body) in zip(touched, records, strict=True):
        if opcode == _CHUNK and not hit:
            for inner, content in _parsed(_unpacked(body), 0):
                if inner == _MESSAGE:
                    channel, _, log_ns, _ = struct.unpack_from('<HIQQ', content)
                    due.add((topics[channel], log_ns, content[22:]))
    return due


def _all_records(records: Sequence[Record]) -> list[Record]:
    inner = [_parsed(_unpacked(body), 0) for opcode, body in records if opcode == _CHUNK]
    return [*records, *(record for some in inner for record in some)]


def _text(body: bytes, start: int) -> str:
    [length] = struct.unpack_from('<I', body, start)
    return body[start + 4 : start + 4 + length].decode()


def _stored(recording: Recording) -> set[Message]:
    return {(m.topic, m.log_ns, m.data) for m in recording.stored_messages()}


def _samples() -> list[tuple[str, str, int, bytes]]:
    stamps = _START + np.arange(_N) * MS
    angle = np.sin(np.arange(2 * _N)).reshape(_N, 2)
    joints = encode_joint_states(['motor_x', 'motor_y'], stamps, position=angle)
    wires = encode_joint_states(['wire_x_pos', 'wire_x_neg'], stamps, effort=5.0 + angle)
    samples = []
    for k, (stamp, motor, wire) in enumerate(zip(stamps.tolist(), joints, wires, strict=True)):
        samples.append(('/rig/motor/measured_js', JOINT_STATE, stamp, bytes(motor)))
        samples.append(('/rig/wires/measured_js', JOINT_STATE, stamp, bytes(wire)))
        samples.append(('/rig/note', STRING, stamp, bytes(encode_string(f'note {k}'))))
    return samples


def _of_this_project(path: Path) -> bytes:
    with BagWriter(path, chunk_seconds=0.02) as writer:
        for k, (topic, kind, stamp, data) in enumerate(_samples()):
            writer.write_raw(topic, kind, data, stamp, stamp, k // 3 + 1)
    return path.read_bytes()


def _of_another_program(path: Path, compression: CompressionType, chunked: bool) -> bytes:
    with path.open('wb') as file:
        writer = Writer(
            file,
            compression=compression,
            use_chunking=chunked,
            chunk_size=8192,
            enable_data_crcs=not chunked,
        )
        writer.start(profile='ros2', library='other')
        schemas: dict[str, int] = {}
        channels: dict[str, int] = {}
        for k, (topic, kind, stamp, data) in enumerate(_samples()):
            if kind not in schemas:
                schemas[kind] = writer.register_schema(kind, 'ros2msg', b'std_msgs/Header header\n')
            if topic not in channels:
                qos = {'offered_qos_profiles': '- history: 1\n  depth: 10\n  reliability: 1\n'}
                channels[topic] = writer.register_channel(topic, 'cdr', schemas[kind], qos)
            writer.add_message(channels[topic], stamp, data, stamp, k // 3 + 1)
        writer.finish()
    return path.read_bytes()


def _parsed(data: bytes, position: int = len(MAGIC)) -> list[Record]:
    records = []
    while position + 9 <= len(data) and data[position:] != MAGIC:
        opcode, length = struct.unpack_from('<BQ', data, position)
        records.append((opcode, data[position + 9 : position + 9 + length]))
        position += 9 + length
    return records


def _built(records: Sequence[Record]) -> bytes:
    return b''.join(struct.pack('<BQ', opcode, len(body)) + body for opcode, body in records)


def _unpacked(body: bytes) -> bytes:
    _, _, size, _, length = _CHUNK_HEAD.unpack_from(body)
    name, packed = body[32 : 32 + length], body[40 + length :]
    if name == b'zstd':
        return zstandard.decompress(packed, size)
    return lz4.frame.decompress(packed) if name == b'lz4' else packed


def _restructured(data: bytes, rng: Generator) -> bytes:
    """A recording of other records, whose checksums agree where they would hide the rest."""
    records = _parsed(data)
    # Kept, so that no other body takes the id of one.
    sound = {id(body): body for _, body in records}
    for _ in range(rng.integers(1, 4)):
        k = int(rng.integers(len(records)))
        # Most records are indexes, which nothing reads.
        if records[k][0] in (7, 8) and rng.random() < 0.9:
            k = next((j for j, r in enumerate(records) if r[0] == _CHUNK), k)
        if records[k][0] == _CHUNK and id(records[k][1]) in sound and rng.random() < 0.7:
            records[k] = (_CHUNK, _other_chunk(records[k][1], rng))
        else:
            _change(records, k, rng)
    if rng.random() < 0.7:
        records = [(o, bytes(4) if o == _DATA_END and len(b) == 4 else b) for o, b in records]
        records = [(o, bytes(20) if o == _FOOTER and len(b) == 20 else b) for o, b in records]
        records = [(o, b) for o, b in records if o != 11 or rng.random() < 0.2]
    body = bytearray(MAGIC + _built(records) + MAGIC)
    if rng.random() < 0.15:
        _lie_about_length(body, records, rng)
    return bytes(body)


def _lie_about_length(body: bytearray, records: Sequence[Record], rng: Generator) -> None:
    position = len(MAGIC)
    for _, content in records[: int(rng.integers(len(records)))]:
        position += 9 + len(content)
    lie = boundary(rng) if rng.random() < 0.5 else int(rng.integers(1 << 16))
    struct.pack_into('<Q', body, position + 1, lie)


def _change(records: list[Record], k: int, rng: Generator) -> None:
    opcode, body = records[k]
    way = rng.integers(8)
    if way == 0:
        del records[k : k + int(rng.integers(1, 4))]
        records.append((opcode, body))
    elif way == 1:
        times = min(int(2.0 ** rng.uniform(1.0, 13.0)), (1 << 22) // (len(body) + 9) + 1)
        records[k:k] = [(opcode, body)] * times
    elif way == 2:
        records[k] = (int(rng.integers(256)), body)
    elif way == 3:
        records[k] = (opcode, body[: rng.integers(len(body) + 1)])
    elif way == 4:
        j = int(rng.integers(len(records)))
        records[k], records[j] = records[j], records[k]
    elif way == 5 and opcode in (_SCHEMA, _CHANNEL, _METADATA):
        records[k] = (opcode, _renamed(opcode, body, rng))
    else:
        records[k] = (opcode, _other_number(body, rng))


def _other_number(body: bytes, rng: Generator) -> bytes:
    width, code = ((2, '<H'), (4, '<I'), (8, '<Q'))[rng.integers(3)]
    if len(body) < width:
        return body
    changed = bytearray(body)
    # Fields lie at the beginning of most records.
    place = int((len(body) - width + 1) * rng.random() ** 3)
    struct.pack_into(code, changed, place, boundary(rng) % 256**width)
    return bytes(changed)


def _renamed(opcode: int, body: bytes, rng: Generator) -> bytes:
    name = str(rng.choice(EVIL_NAMES)).encode()[:65000]
    text = str(rng.choice(EVIL_SCALARS)).encode()
    if opcode == _METADATA:
        content = _prefixed(b'lost /a' if rng.random() < 0.5 else name) + _prefixed(text)
        return _prefixed(b'endoscope_bags') + _prefixed(content)
    if opcode == _SCHEMA:
        return body[:2] + _prefixed(name) + _prefixed(b'ros2msg') + _prefixed(text)
    profile = b'- history: ' + text + b'\n  depth: ' + text
    qos = _prefixed(b'offered_qos_profiles') + _prefixed(profile if rng.random() < 0.5 else text)
    topic = name if rng.random() < 0.5 else b'/rig/motor/measured_js'
    return body[:4] + _prefixed(topic) + _prefixed(b'cdr') + _prefixed(qos)


def _prefixed(text: bytes) -> bytes:
    return struct.pack('<I', len(text)) + text


def _other_chunk(body: bytes, rng: Generator) -> bytes:
    begin, end, size, crc, length = _CHUNK_HEAD.unpack_from(body)
    name = body[32 : 32 + length]
    records = _unpacked(body)
    way = rng.integers(1, 5) if rng.random() < 0.95 else 0
    if way == 0:
        name, size, packed = _bomb(int(rng.integers(4)), _BOMB_MEGABYTES[rng.integers(2)])
        claimed = (size, size, 1 << 20, boundary(rng))[rng.integers(4)]
        return _chunk(begin, end, claimed, 0, name, packed)
    if way == 1:
        return _chunk(begin, end, boundary(rng), crc, name, body[40 + length :])
    if way == 2:
        inner = _parsed(records, 0)
        for _ in range(rng.integers(1, 4)):
            _change(inner, int(rng.integers(len(inner))), rng)
        records = _built(inner)
    elif way == 3:
        records = spoiled_bytes(records, rng)
    else:
        packed = spoiled_bytes(body[40 + length :], rng)
        return _chunk(begin, end, size, crc, name, packed)
    name = (b'zstd', b'lz4', b'', b'brotli')[rng.integers(4)]
    return _chunk(begin, end, len(records), zlib.crc32(records), name, _packed(name, records))


def _chunk(begin: int, end: int, size: int, crc: int, name: bytes, packed: bytes) -> bytes:
    head = _CHUNK_HEAD.pack(begin, end, size, crc, len(name))
    return head + name + struct.pack('<Q', len(packed)) + packed


def _packed(name: bytes, records: bytes) -> bytes:
    if name == b'zstd':
        return zstandard.compress(records)
    return lz4.frame.compress(records) if name == b'lz4' else records


@cache
def _bomb(number: int, megabytes: int) -> tuple[bytes, int, bytes]:
    """Few bytes that become many: zeros, or the shortest messages, in either compression."""
    message = _built([(_MESSAGE, struct.pack('<HIQQ', 1, 1, _START, _START))])
    piece = bytes(1 << 20) if number % 2 else message * ((1 << 20) // len(message))
    size = megabytes * len(piece)
    if number < 2:
        zstd = zstandard.ZstdCompressor(level=1).compressobj()
        packed = b''.join(zstd.compress(piece) for _ in range(megabytes)) + zstd.flush()
        return b'zstd', size, packed
    with lz4.frame.LZ4FrameCompressor() as frame:
        packed = frame.begin() + b''.join(frame.compress(piece) for _ in range(megabytes))
        return b'lz4', size, packed + frame.flush()
