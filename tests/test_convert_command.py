"""`endoscope convert`, and a recording of a real machine that comes with the project."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from endoscope_bags import open_bag
from endoscope_bringup.cli import main

REAL = Path(__file__).parent / 'recordings/servo_backlash'
TABLE = str(REAL / 'motor_telemetry_single.csv')
COUNT = 2.0 * np.pi / 4096.0


def test_without_a_mapping_columns_are_listed_and_nothing_is_written(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(['convert', TABLE]) == 0
    output = capsys.readouterr().out
    assert 'target pos (5)' in output
    assert '--propose' in output
    assert main(['convert', TABLE, '--out', 'bag']) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert 'bag is not written' in line
    assert '--mapping' in line
    assert list(tmp_path.iterdir()) == []


def test_a_proposal_is_written_once_and_shown_as_json(tmp_path, capsys):
    path = tmp_path / 'mapping.yaml'
    assert main(['convert', TABLE, '--propose', str(path), '--json']) == 0
    proposal = json.loads(capsys.readouterr().out)
    assert path.read_text() == proposal['mapping']
    assert proposal['rows'] == 138
    time, target = proposal['columns'][:2]
    assert (time['title'], time['first']) == ('timestamp', '2025-11-09T09:27:03.748Z')
    assert (target['low'], target['high']) == (1947.0, 2147.0)
    assert main(['convert', TABLE, '--propose', str(path)]) == 2
    assert 'exists already' in capsys.readouterr().err


def test_a_real_servo_is_read_with_its_dates_and_shows_its_backlash(tmp_path):
    out = tmp_path / 'servo'
    assert main(['convert', TABLE, '--mapping', str(REAL / 'mapping.yaml'), '--out', str(out)]) == 0
    bag = open_bag(out)
    target, position = (bag.joint_state(f'slave/{name}') for name in ('servo_jp', 'measured_js'))
    assert len(target) == len(position) == 138
    # 2025-11-09T09:27:03.748Z
    assert target.stamp_ns[0] == 1_762_680_423_748_000_000
    assert target.seconds()[-1] == pytest.approx(13.809)
    assert np.unique(np.round(target.position / COUNT)).tolist() == [-100.0, 0.0, 100.0]
    assert position.position.min() / COUNT == pytest.approx(-94.0)
    assert position.position.max() / COUNT == pytest.approx(95.0)
    # It comes to rest short of its target from either side; a light pull moves it in between.
    seconds, counts = target.seconds(), position.position[:, 0] / COUNT
    at_zero = np.abs(target.position[:, 0]) < COUNT / 2
    from_below = counts[at_zero & (seconds > 1.4) & (seconds < 1.9)]
    from_above = counts[at_zero & (seconds > 7.9) & (seconds < 8.3)]
    assert (np.ptp(from_below), np.ptp(from_above)) == (0.0, 0.0)
    assert from_below[0] == pytest.approx(-5.0)
    assert from_above[0] == pytest.approx(6.0)
    assert np.degrees((from_above[0] - from_below[0]) * COUNT) == pytest.approx(0.967, abs=1e-3)
    held = at_zero & (seconds > 1.4) & (seconds < 6.3)
    assert np.degrees(np.ptp(counts[held]) * COUNT) == pytest.approx(1.494, abs=1e-3)
    # It starts 0.2 s after its target jumps, and needs 0.6 s.
    jump = int(np.argmax(target.position[:, 0] > 50 * COUNT))
    moved = counts[jump:] - counts[jump]
    assert seconds[jump + int(np.argmax(moved > 1))] - seconds[jump] == pytest.approx(0.2, abs=0.03)
    arrived = seconds[jump + int(np.argmax(moved >= moved.max()))] - seconds[jump]
    assert arrived == pytest.approx(0.6, abs=0.03)


def test_a_long_table_takes_little_memory_and_shows_how_far_it_is(tmp_path):
    row = ','.join(['0.12345678901'] * 9)
    with (tmp_path / 'long.csv').open('w') as file:
        file.writelines(f'{k}e-3,{row}\n' for k in range(150_000))
    (tmp_path / 'mapping.yaml').write_text(
        'time: {column: 1, unit: s}\ntopics:\n'
        '  motor/servo_jp: {position: {motor_x: {column: 2}, motor_y: {column: 3}}}\n'
        '  slave/measured_js: {position: {bend_x: {column: 4}, bend_y: {column: 5}}}\n'
    )
    code = (
        'from endoscope_bringup.cli import main\n'
        "status = main('convert long.csv --mapping mapping.yaml --out bag'.split())\n"
        # Not ru_maxrss, which begins with that of the process that started this one.
        "[peak] = [x for x in open('/proc/self/status') if x.startswith('VmHWM')]\n"
        'print(status, peak.split()[1])\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    output, (status, peak_kb) = done.stdout.splitlines()[0], done.stdout.split()[-2:]
    assert (output, status) == (
        'bag: 300000 messages of 150000 rows',
        '0',
    )
    assert done.stderr.splitlines()[0] == 'reading the table'
    assert int(peak_kb) < 300_000


def test_a_table_is_to_be_converted_before_it_is_explained(tmp_path, capsys):
    (tmp_path / 'table.csv').write_text('time,angle\n0,1\n1,2\n')
    table = str(tmp_path / 'table.csv')
    assert main(['bag', 'info', table]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert f'is converted first: endoscope convert {table} --propose mapping.yaml' in line
