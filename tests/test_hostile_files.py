"""Damaged and crafted files: one line or a right answer, little memory, no traceback."""

import math
import re
import shutil
import warnings
from dataclasses import asdict

import numpy as np
import pytest
from counted_bag import N, says_one_line, write_bag
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from endoscope_bags import open_bag
from endoscope_bags.copying import recover
from endoscope_bags.information import bag_information
from endoscope_bags.table_mapping import load_table_mapping
from endoscope_bags.text_table import convert_table
from endoscope_core.errors import EndoscopeError
from endoscope_core.physics import EffectSpec, PlantDescription, TermSpec, load_plant, save_plant
from endoscope_core.physics.description import NUMBERS
from endoscope_core.rig import load_rig
from endoscope_core.rig.facts import SHIPPED
from endoscope_core.signals.sampled_motion import read_command_file, write_command_file
from endoscope_devices.load_cells import load_calibration
from endoscope_nodes.names import WIRES

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
        (folder / 'cells.yaml').write_text(CELLS)
        (folder / 'mapping.yaml').write_text(MAPPING)
        (folder / 'table.csv').write_text(TABLE)
        shutil.copy(SHIPPED, folder / 'rig.yaml')

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
        else:
            out = self.folder / 'converted'
            try:
                mapping = load_table_mapping(self.folder / 'mapping.yaml')
                converted = convert_table(self.folder / 'table.csv', mapping, out)
                assert open_bag(out).message_count == converted.messages
            finally:
                shutil.rmtree(out, ignore_errors=True)

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
