import math
import re

import numpy as np
import pytest

from endoscope_bags import BagError, open_bag
from endoscope_bags.information import bag_information
from endoscope_bags.table_mapping import load_table_mapping
from endoscope_bags.text_table import convert_table
from endoscope_core.errors import FileError

MAPPING = """
time: {column: 1, unit: s}
start_s: 100.0
topics:
  slave/servo_jp:
    position: {bend_x: {column: 2, unit: deg}}
  slave/measured_js:
    position: {bend_x: {column: 3, unit: deg, offset: 1.0}}
  wires/measured_js:
    effort: {wire_x_pos: {column: 4, unit: N}, wire_x_neg: {column: 5, unit: N, scale: 2.0}}
"""


@pytest.fixture
def mapping(tmp_path):
    path = tmp_path / 'mapping.yaml'
    path.write_text(MAPPING)
    return load_table_mapping(path)


@pytest.fixture
def table(tmp_path):
    path = tmp_path / 'table.txt'
    time = np.repeat(np.arange(40) * 0.025, 3)
    rows = [
        f'{t:.6f}, {60 * math.sin(t):.6f}, {30 * math.sin(t):.6f}, {5 + t:.6f}, {5 - t:.6f} '
        for t in time
    ]
    path.write_text('\n'.join(rows) + '\n')
    return path


def test_columns_become_topics_in_si_and_repeats_go(table, mapping, tmp_path):
    done = convert_table(table, mapping, tmp_path / 'bag')
    assert (done.rows, done.repeated, done.messages) == (120, 80, 120)
    bag = open_bag(tmp_path / 'bag')
    command, bending = bag.joint_state('slave/servo_jp'), bag.joint_state('slave/measured_js')
    wires = bag.joint_state('wires/measured_js')
    time = np.arange(40) * 0.025
    assert command.topic == '/endoscope/slave/servo_jp'
    assert command.stamp_ns * 1e-9 == pytest.approx(100.0 + time, abs=1e-6)
    assert command.position[:, 0] == pytest.approx(np.radians(60 * np.sin(time)), abs=1e-6)
    assert bending.position[:, 0] == pytest.approx(np.radians(30 * np.sin(time) + 1), abs=1e-6)
    assert wires.names == ('wire_x_pos', 'wire_x_neg')
    assert wires.effort == pytest.approx(np.stack([5 + time, 2 * (5 - time)], axis=1), abs=1e-6)


def test_repeats_are_kept_where_asked(table, tmp_path):
    path = tmp_path / 'mapping.yaml'
    path.write_text(MAPPING + 'drop_repeats: false\n')
    assert convert_table(table, load_table_mapping(path), tmp_path / 'bag.mcap').repeated == 0


def test_a_table_written_faster_than_its_sources_gives_each_number_its_own_time(tmp_path):
    # Four rows a time; the command is new in the first, the angle in the second, every other time
    # only, one wire in the third and the other one in the fourth.
    rows = [
        f'{0.025 * n:.3f}, {n}, {(n - (k < 1)) // 2}, {n + 3 * (k >= 2)}, {n - 2 * (k == 3)}'
        for n in range(10)
        for k in range(4)
    ]
    (tmp_path / 'table.txt').write_text('\n'.join(rows))
    path = tmp_path / 'mapping.yaml'
    path.write_text(MAPPING + 'sample_and_hold: true\n')
    done = convert_table(tmp_path / 'table.txt', load_table_mapping(path), tmp_path / 'bag')
    bag = open_bag(tmp_path / 'bag')
    command, bending = bag.joint_state('slave/servo_jp'), bag.joint_state('slave/measured_js')
    wires = bag.joint_state('wires/measured_js')
    stamps = 100.0 + 0.025 * np.arange(10)
    assert command.stamp_ns * 1e-9 == pytest.approx(stamps, abs=1e-6)
    assert command.position[:, 0] == pytest.approx(np.radians(np.arange(10)), abs=1e-6)
    # -1, in force at first, then 0 to 4.
    assert bending.stamp_ns * 1e-9 == pytest.approx(np.r_[100.0, stamps[::2] + 0.00625], abs=1e-6)
    assert bending.position[:, 0] == pytest.approx(np.radians(np.arange(6)), abs=1e-6)
    fresh = np.sort(np.r_[stamps, stamps + 0.0125, stamps + 0.01875])
    assert wires.stamp_ns * 1e-9 == pytest.approx(fresh, abs=1e-6)
    assert (done.rows, done.held, done.messages) == (40, 5, 10 + 6 + 30)
    assert (
        str(done)
        == '46 messages of 40 rows; dropped rows: 5 that repeat what their sources gave before'
    )


def test_a_source_that_rests_has_samples_all_the_same(tmp_path):
    """A table at 1 kHz of an encoder read at 100 Hz, which rests for a second."""
    angle = np.repeat(np.r_[np.arange(100), np.full(100, 99), np.arange(99, 0, -1)], 10)
    rows = [f'{k * 1e-3:.3f}, {k}, {q}, 5, 5' for k, q in enumerate(angle)]
    (tmp_path / 'table.txt').write_text('\n'.join(rows))
    path = tmp_path / 'mapping.yaml'
    path.write_text(MAPPING + 'sample_and_hold: true\n')
    convert_table(tmp_path / 'table.txt', load_table_mapping(path), tmp_path / 'bag')
    [measured] = [
        t
        for t in bag_information(open_bag(tmp_path / 'bag')).topics
        if t.name.endswith('slave/measured_js')
    ]
    assert (measured.rate_hz, measured.gaps, measured.message_count) == (
        pytest.approx(100.0),
        0,
        299,
    )


def test_what_samples_and_holds_needs_more_than_one_time(tmp_path):
    (tmp_path / 'table.txt').write_text('1, 2, 3, 4, 5\n1, 2, 3, 4, 6\n')
    path = tmp_path / 'mapping.yaml'
    path.write_text(MAPPING + 'sample_and_hold: true\n')
    with pytest.raises(BagError, match='all rows have the same time'):
        convert_table(tmp_path / 'table.txt', load_table_mapping(path), tmp_path / 'bag')
    assert not (tmp_path / 'bag').exists()


@pytest.mark.parametrize(
    ('old', 'new', 'message'),
    [
        ('time: {column: 1, unit: s}', '', 'time is missing'),
        (
            'unit: deg}',
            'unit: grad}',
            "topics.slave/servo_jp.position.bend_x.unit is 'grad': give one of rad, mrad, deg",
        ),
        ('column: 3', 'colum: 3', 'unknown key colum'),
        ('column: 3', 'column: 0', 'from 1'),
        ('position: {bend_x: {column: 2', 'angle: {bend_x: {column: 2', 'unknown key angle'),
        ('start_s: 100.0', 'start_s: soon', "start_s is 'soon'"),
        ('slave/servo_jp', 'slave/servo_jq', 'did you mean slave/servo_jp?'),
        ('bend_x: {column: 2', 'bnd_x: {column: 2', 'did you mean bend_x?'),
        (
            'start_s: 100.0',
            'incomplete_rows: skip',
            "incomplete_rows is 'skip': give one of refuse, drop",
        ),
        (
            'start_s: 100.0',
            'drop_repeats: true\nsample_and_hold: true',
            'drop_repeats has no meaning beside sample_and_hold',
        ),
    ],
)
def test_a_wrong_mapping_is_refused_by_its_key(tmp_path, old, new, message):
    path = tmp_path / 'mapping.yaml'
    path.write_text(MAPPING.replace(old, new, 1))
    with pytest.raises(FileError, match=re.escape(message)):
        load_table_mapping(path)


@pytest.mark.parametrize(
    ('text', 'error', 'message'),
    [
        ('0,1,1,5,5\n' * 20 + '1,1,1,5\n', BagError, 'line 21 has 4 columns, 5 are needed'),
        ('0,1,1,5,5\n1,one,1,5,5\n', BagError, "line 2, column 2: 'one' is not a number"),
        ('0,1,1,5,5\n', BagError, 'fewer than two rows'),
        ('1,1,1,5,5\n0,1,1,5,5\n', BagError, 'line 2: time runs backwards, from 101 to 100 s'),
        (
            '0,1,1,5,5\n1,1,nan,5,5\n',
            BagError,
            'line 2: position of slave/measured_js is not finite; 1 of 2 rows are so; `incomplete_',
        ),
    ],
)
def test_a_wrong_table_is_refused_and_nothing_is_written(tmp_path, mapping, text, error, message):
    path = tmp_path / 'table.txt'
    path.write_text(text)
    with pytest.raises(error, match=re.escape(message)):
        convert_table(path, mapping, tmp_path / 'bag')
    assert not (tmp_path / 'bag').exists()


def test_incomplete_rows_are_counted_and_dropped_where_the_mapping_says_so(tmp_path):
    path = tmp_path / 'mapping.yaml'
    path.write_text(MAPPING + 'incomplete_rows: drop\n')
    table = tmp_path / 'table.txt'
    table.write_text('t,u,q,a,b\n0,1,nan,5,5\n1,1,1,5,\n2,1,1,,\n3,1,1,5,5\n')
    done = convert_table(table, load_table_mapping(path), tmp_path / 'bag')
    assert done.incomplete == {'slave/measured_js': 1, 'wires/measured_js': 1}
    assert '1 of wires/measured_js for a cell without a number' in str(done)
    assert '2 of column 5 (b)' in str(done)
    assert done.gaps == {'column 3 (q)': 1, 'column 4 (a)': 1, 'column 5 (b)': 2}
    bag = open_bag(tmp_path / 'bag')
    stamps = {topic: bag.joint_state(topic).stamp_ns * 1e-9 - 100.0 for topic in bag.topics}
    assert {topic: at.tolist() for topic, at in stamps.items()} == {
        '/endoscope/slave/servo_jp': [0.0, 1.0, 2.0, 3.0],
        '/endoscope/slave/measured_js': [1.0, 2.0, 3.0],
        '/endoscope/wires/measured_js': [0.0, 3.0],
    }
