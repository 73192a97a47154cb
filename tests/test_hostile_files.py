"""Damaged and crafted files: one line or a right answer, little memory, no traceback."""

import math
import re
import shutil
import struct
import subprocess
import sys
import warnings
import zlib
from dataclasses import asdict

import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import Writer

from endoscope_bags import BagError, BagWriter, open_bag
from endoscope_bags.cdr_encoding import encode_joint_state, encode_string
from endoscope_bags.copying import recover
from endoscope_bags.errors import MalformedMessageError
from endoscope_bags.information import bag_information
from endoscope_bags.mcap_records import MAGIC
from endoscope_bags.message_types import JOINT_STATE, STRING
from endoscope_bags.table_mapping import load_table_mapping
from endoscope_bags.text_table import convert_table
from endoscope_bags.unpacking import LARGEST_CHUNK
from endoscope_bringup.cli import main
from endoscope_core.classifier.weights_file import load_classifier, shipped_weights
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import EffectSpec, PlantDescription, TermSpec, load_plant, save_plant
from endoscope_core.physics.description import NUMBERS
from endoscope_core.rig import load_rig
from endoscope_core.rig.facts import SHIPPED
from endoscope_core.signals import SINUSOID
from endoscope_core.signals.command_file import read_command_file, write_command_file
from endoscope_devices.load_cells import load_calibration
from endoscope_nodes.names import WIRES

MS = 10**6
N = 400
CHUNK, CHANNEL, MESSAGE, DATA_END, FOOTER = 6, 4, 5, 15, 2
TOPIC = '/rig/slave/servo_jp'
NUMBERS_THAT_TURN = sorted(
    {0} | {n for k in (7, 8, 15, 16, 31, 32, 34, 62, 63) for n in (2**k - 1, 2**k)} | {2**64 - 1}
)
EVIL = (
    *('1e308', '-1e308', '1e400', '.nan', '-.inf', '-1', '0', str(2**64), '9' * 5000, '0x' + 'f'),
    *('1:' * 3000 + '1', '2024-13-01', '2024-02-30T25:61:61Z', '[' * 5000, '{a: ' * 500),
    *('*anchor', '&anchor [1, 2]', '!!python/object/apply:os.system [true]', '!!binary gA==', '<<'),
    *('null', 'true', '[]', '{}', '{a: 1, a: 2}', '? [a]\n: b', '"\\x1b[2J"', "''", 'x' * 100_000),
    *('\x1b[2J\x1b]0;owned\x07', '\x9b31m', '\u202egnp.exe', '/a\n/b', '\x00', '../../etc/passwd'),
)
CELLS = """
transmitter: {unit: 1, registers: input, rate: 200.0, serial: {baud: 115200, parity: none}}
wires:
  wire_x_pos: {register: 0, type: int32, newton_per_count: 0.001, sign: 1, zero: 120}
  wire_x_neg: {register: 2, type: int32, newton_per_count: 0.001}
  wire_y_pos: {register: 4, type: int32, newton_per_count: 0.001}
  wire_y_neg: {register: 6, type: int32, newton_per_count: 0.001}
faults: {broken_below: -200000, broken_above: 200000, saturated_above: 150000}
tare: {noise: 0.1, drift: 0.05, largest: 2.0, shaft_speed: 0.02}
"""
MAPPING = """
time: {column: 1, unit: s}
delimiter: ','
header_lines: 1
namespace: /rig
topics:
  slave/servo_jp:
    position: {bend_x: {column: 2, unit: deg}}
  wires/measured_js:
    effort: {wire_x_pos: {column: 3, unit: N}, wire_x_neg: {column: 4, unit: N, scale: 2.0}}
"""
TABLE = 'time,bend,pos,neg\n' + ''.join(f'{k / 100},{math.sin(k):.4f},5,6\n' for k in range(50))


def write_bag(path):
    with BagWriter(path, chunk_seconds=0.02) as writer:
        for k in range(N):
            data = encode_joint_state(['bend_x'], k * MS, position=[k])
            writer.write_raw(TOPIC, JOINT_STATE, data, k * MS, k * MS, k + 1)
    return path


def says_one_line(error):
    assert str(error)
    assert str(error).isprintable()


@st.composite
def spoiled_bytes(draw, data):
    """What a disk, a cable, a crash or a clever hand makes of bytes."""
    data = bytearray(data)
    for _ in range(draw(st.integers(1, 3))):
        place = draw(st.integers(0, len(data)))
        span = slice(place, place + draw(st.sampled_from((1, 2, 8, 100, 4000))))
        way = draw(st.sampled_from(('cut', 'delete', 'repeat', 'empty', 'flip', 'flip', 'number')))
        if way == 'cut':
            del data[place:]
        elif way == 'delete':
            del data[span]
        elif way == 'repeat':
            data[place:place] = data[span]
        elif way == 'empty':
            data[span] = bytes(len(data[span]))
        elif way == 'flip':
            for k in draw(st.lists(st.integers(0, max(len(data) - 1, 0)), max_size=30)):
                data[k : k + 1] = [b ^ draw(st.integers(1, 255)) for b in data[k : k + 1]]
        else:
            width = draw(st.sampled_from((2, 4, 8)))
            number = draw(st.sampled_from(NUMBERS_THAT_TURN)) % 256**width
            data[place : place + width] = number.to_bytes(width, 'little')
    return bytes(data)


@st.composite
def spoiled_text(draw, data):
    """Other lines, keys, values and cells of a text; sometimes other bytes."""
    lines = data.decode().split('\n')
    for _ in range(draw(st.integers(1, 3))):
        k, other = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
        evil = draw(st.sampled_from(EVIL))
        way = draw(st.sampled_from(('swap', 'repeat', 'indent', 'append', *3 * ('value', 'cell'))))
        if way == 'swap':
            lines[k], lines[other] = lines[other], lines[k]
        elif way == 'repeat':
            lines.insert(k, lines[other])
        elif way == 'indent':
            lines[k] = '   ' + lines[k]
        elif way == 'append':
            lines[k] += evil
        elif way == 'value':
            lines[k] = f'{lines[k].partition(":")[0]}: {evil}'
        else:
            lines[k] = re.sub(r'[^,{}]+(?=[,}]|$)', lambda _, e=evil: e, lines[k], count=1)
    data = '\n'.join(lines).encode(errors='surrogatepass')
    return draw(spoiled_bytes(data)) if draw(st.integers(0, 3)) == 0 else data


class Files:
    """A sound file of each kind, and what is read of it."""

    def __init__(self, folder):
        self.folder = folder
        self.sound = {}
        plant = PlantDescription(
            effects=(EffectSpec('gravity', 'bend_x', {'moment_nm': 0.01}),),
            terms=(TermSpec('bend_x', 'load_of_angle', '0.01*tanh(q/0.5)', range=(-1.5, 1.5)),),
        )
        save_plant(plant, folder / 'plant.yaml')
        time = np.arange(0.0, 1.0, 0.01)
        write_command_file(folder / 'command.csv', time, np.sin(np.c_[time, 2.0 * time]))
        write_bag(folder / 'case.mcap')
        write_bag(folder / 'bag')
        for name, text in {
            'cells.yaml': CELLS,
            'mapping.yaml': MAPPING,
            'table.csv': TABLE,
        }.items():
            (folder / name).write_text(text)
        shutil.copy(SHIPPED, folder / 'rig.yaml')
        weights = shipped_weights(SINUSOID)
        shutil.copy(weights, folder / 'weights.safetensors')
        shutil.copy(weights.with_suffix('.json'), folder / 'weights.json')

    def path(self, kind):
        return self.folder / {'metadata.yaml': 'bag/metadata.yaml'}.get(kind, kind)

    def sound_bytes(self, kind):
        return self.sound.setdefault(kind, self.path(kind).read_bytes())

    def read(self, kind):
        """Read a file of a kind with all that reads such files; what comes out has to be right."""
        path = self.path(kind)
        if kind in ('case.mcap', 'metadata.yaml'):
            recording = open_bag(path if kind == 'case.mcap' else path.parent)
            assert str(bag_information(recording)).encode()
            position = recording.joint_state('slave/servo_jp').require('position')
            np.testing.assert_array_equal(position[:, 0], np.arange(N))
        elif kind == 'plant.yaml':
            plant = load_plant(path)
            for parameters in (*plant.joints.values(), plant.sensors):
                for key, value in asdict(parameters).items():
                    assert (NUMBERS[key].low <= np.atleast_1d(value)).all(), key
                    assert (np.atleast_1d(value) <= NUMBERS[key].high).all(), key
        elif kind == 'rig.yaml':
            load_rig(path)
        elif kind == 'cells.yaml':
            cells = load_calibration(path, WIRES).wires.values()
            assert all(math.isfinite(cell.tension(1e5)) for cell in cells)
        elif kind == 'command.csv':
            table = read_command_file(path)
            assert (np.diff(table.time) > 0.0).all()
            assert np.isfinite(table.angle).all()
        elif kind in ('mapping.yaml', 'table.csv'):
            out = self.folder / 'converted'
            try:
                mapping = load_table_mapping(self.folder / 'mapping.yaml')
                converted = convert_table(self.folder / 'table.csv', mapping, out)
                assert open_bag(out).message_count == converted.messages
            finally:
                shutil.rmtree(out, ignore_errors=True)
        else:
            load_classifier(self.folder / 'weights.safetensors', SINUSOID)

    def recovered(self):
        """Whatever is saved of a damaged recording was recorded."""
        out = self.folder / 'recovered'
        try:
            recover(self.path('case.mcap'), out)
            saved = {(m.log_ns, m.data) for m in open_bag(out).stored_messages()}
        finally:
            shutil.rmtree(out, ignore_errors=True)
        self.path('case.mcap').write_bytes(self.sound_bytes('case.mcap'))
        sound = open_bag(self.path('case.mcap'))
        assert saved <= {(m.log_ns, m.data) for m in sound.stored_messages()}


@pytest.fixture(scope='module')
def files(tmp_path_factory):
    return Files(tmp_path_factory.mktemp('files'))


KINDS = {
    'case.mcap': spoiled_bytes,
    'weights.safetensors': spoiled_bytes,
    'weights.json': spoiled_text,
    'metadata.yaml': spoiled_text,
    'plant.yaml': spoiled_text,
    'rig.yaml': spoiled_text,
    'cells.yaml': spoiled_text,
    'mapping.yaml': spoiled_text,
    'command.csv': spoiled_text,
    'table.csv': spoiled_text,
}
MANY = pytest.param(500, marks=pytest.mark.nightly)


@pytest.mark.parametrize('examples', [40, MANY])
@pytest.mark.parametrize('kind', KINDS)
def test_whatever_a_file_holds_is_one_line_or_a_right_answer(files, kind, examples):
    sound = files.sound_bytes(kind)

    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        suppress_health_check=[HealthCheck.too_slow, HealthCheck.large_base_example],
    )
    @given(KINDS[kind](sound))
    def tried(data):
        path = files.path(kind)
        path.write_bytes(data)
        readers = [lambda: files.read(kind)]
        if kind == 'case.mcap':
            readers.append(files.recovered)
        try:
            with warnings.catch_warnings():
                # A warning is a second line.
                warnings.simplefilter('error')
                for read in readers:
                    try:
                        read()
                    except EndoscopeError as error:
                        says_one_line(error)
        finally:
            path.write_bytes(sound)

    tried()


# ---- recordings that were built by hand


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


@pytest.mark.parametrize('declared', [1 << 34, 1 << 10])
def test_a_zstd_frame_may_not_lie_about_its_size(path, whole, declared):
    packed = bytearray(zstandard.ZstdCompressor(write_content_size=True).compress(bytes(1 << 20)))
    # Magic, descriptor (single segment, 4 bytes of size), size.
    assert packed[4] >> 6 == 2
    packed[5:9] = struct.pack('<I', declared % 2**32)
    path.write_bytes(replaced(whole, CHUNK, lambda _: chunk(bytes(packed), 1 << 20)))
    one_line(path, 'chunk 1 .* is damaged', N - 20)


def bomb(name):
    packer = zstandard.ZstdCompressor().compressobj()
    piece = bytes(1 << 20)
    if name == b'zstd':
        return b''.join(packer.compress(piece) for _ in range(1 << 10)) + packer.flush()
    with lz4.frame.LZ4FrameCompressor() as frame:
        body = frame.begin() + b''.join(frame.compress(piece) for _ in range(1 << 8))
        return body + frame.flush()


@pytest.mark.parametrize('name', [b'zstd', b'lz4'])
def test_few_bytes_do_not_become_gigabytes(path, whole, name):
    packed, size = bomb(name), 1 << (30 if name == b'zstd' else 28)
    for claimed, what in ((size, 'it claims'), (1000, 'it does not hold the 1000 bytes')):
        body = chunk(packed, claimed, name)
        path.write_bytes(replaced(whole, CHUNK, lambda _, b=body: b))
        one_line(path, what, N - 20)


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


@pytest.mark.parametrize(
    'text', ['- 1', 'a: [', 'history: 1', '- depth: x', '9' * 5000, '[' * 9000]
)
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
        ("compression_mode: ''", 'compression_mode: [FILE]', 'compression mode'),
        ('storage_identifier: mcap', 'storage_identifier: 7', 'storage 7'),
        ('version: 9', 'version: ' + '9' * 5000, 'a number of 5000 characters'),
        ('version: 9', 'version: &v 9\n  again: *v', 'refers to another place'),
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


# ---- at the command line


@pytest.mark.parametrize(
    ('new', 'what'),
    [
        ('1.0e+308', 'give a number from 0 to 1000 N'),
        ('9' * 5000, 'line 3: a number of 5000 characters'),
        ('"\\e[2J"', r'\\x1b\[2J'),
    ],
)
def test_a_plant_that_cannot_be(tmp_path, capsys, new, what):
    plant, bag, out = tmp_path / 'plant.yaml', write_bag(tmp_path / 'bag'), tmp_path / 'out'
    save_plant(PlantDescription(), plant)
    plant.write_text(plant.read_text().replace('pretension: 5.0', f'pretension: {new}', 1))
    argv = ['simulate', '--plant', str(plant), '--commands', str(bag), '--out', str(out)]
    assert main(argv) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert re.search(what, line)
    says_one_line(line)
    assert not out.exists()


# Set in a shell: beside threads a process must not be forked to set it.
SMALL = 'ulimit -v 2000000; exec "$@"'


def test_few_bytes_take_little_memory(path, whole):
    """Two gigabytes, honestly declared, in less than 100 kB."""
    packer = zstandard.ZstdCompressor().compressobj()
    piece = bytes(1 << 20)
    packed = b''.join(packer.compress(piece) for _ in range(1 << 11)) + packer.flush()
    path.write_bytes(whole[:8] + built([(CHUNK, chunk(packed, 1 << 31))]) + whole[8:])
    assert path.stat().st_size - len(whole) < 100_000
    program = [sys.executable, '-m', 'endoscope_bringup.cli', 'bag', 'info', str(path)]
    done = subprocess.run(
        ['sh', '-c', SMALL, 'sh', *program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert 'it claims 2147483648 bytes' in line
