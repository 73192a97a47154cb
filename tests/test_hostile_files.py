"""Damaged and crafted files on the command line: one line, exit 2, little memory, no traceback."""

import os
import re
import struct
import subprocess
import sys

import pytest
import zstandard

from endoscope_bags import BagWriter
from endoscope_bags.cdr_encoding import encode_string
from endoscope_bags.message_types import STRING
from endoscope_bringup.cli import main
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_lab.hostile_files.trial import KINDS, Outcomes, try_files

MEMORY = 2_000_000_000


@pytest.fixture
def bag(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        for k in range(100):
            writer.write_raw('/a', STRING, encode_string(str(k)), k * 10**6)
    return tmp_path / 'bag'


@pytest.fixture
def plant(tmp_path):
    save_plant(PlantDescription(), tmp_path / 'plant.yaml')
    return tmp_path / 'plant.yaml'


@pytest.mark.parametrize(
    ('old', 'new', 'what'),
    [
        ('pretension: 5.0', 'pretension: 1.0e+308', 'give a number from 0 to 1000 N'),
        ('pretension: 5.0', 'pretension: 5.0\n    pretension: 6.0', 'line 4: key .* given twice'),
        ('pretension: 5.0', 'pretension: ' + '9' * 5000, 'line 3: a number of 5000 characters'),
        ('pretension: 5.0', 'pretension: ' + '[' * 5000, 'line 3: nested deeper'),
        ('pretension: 5.0', 'pretension: 2026-13-01', 'line 3: month must be in 1..12'),
        ('pretension: 5.0', 'pretension: "\\e[2J"', r'\\x1b\[2J'),
    ],
)
def test_a_plant_that_cannot_be(bag, plant, tmp_path, capsys, old, new, what):
    plant.write_text(plant.read_text().replace(old, new, 1))
    out = tmp_path / 'out'
    argv = ['simulate', '--plant', str(plant), '--commands', str(bag), '--out', str(out)]
    assert main(argv) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert re.search(what, line)
    assert line.isprintable()
    assert not out.exists()


def test_a_name_with_escapes_is_shown_as_text(tmp_path, capsys):
    path = tmp_path / 'evil.mcap'
    with BagWriter(path) as writer:
        writer.write_raw('/a\x1b]0;owned\x07\n', STRING, encode_string('x'), 1)
    for argv in (['info', str(path)], ['recover', str(path), str(tmp_path / 'out')]):
        assert main(['bag', *argv]) == 0
        shown = capsys.readouterr().out
        assert r'/a\x1b]0;owned\x07\n' in shown
        assert '\x1b' not in shown


def _zeros(path):
    """Two gigabytes, honestly declared, in less than 100 kB."""
    packer = zstandard.ZstdCompressor().compressobj()
    piece = bytes(1 << 20)
    packed = b''.join(packer.compress(piece) for _ in range(1 << 11)) + packer.flush()
    head = struct.pack('<QQQII', 0, 0, 1 << 31, 0, 4) + b'zstd' + struct.pack('<Q', len(packed))
    body = head + packed
    data = path.read_bytes()
    path.write_bytes(data[:8] + struct.pack('<BQ', 6, len(body)) + body + data[8:])


# Set in a shell: beside threads a process must not be forked to set it.
SMALL = f'ulimit -v {MEMORY // 1024}; exec "$@"'


@pytest.mark.parametrize('command', ['info', 'recover', 'simulate', 'explain'])
def test_few_bytes_take_little_memory(bag, plant, tmp_path, command):
    file = bag / 'bag_0.mcap'
    before = file.stat().st_size
    _zeros(file)
    assert file.stat().st_size - before < 100_000
    out = str(tmp_path / 'out')
    argv = {
        'info': ['bag', 'info', str(bag)],
        'recover': ['bag', 'recover', str(bag), out],
        'simulate': ['simulate', '--plant', str(plant), '--commands', str(bag), '--out', out],
        'explain': ['explain', str(bag), '--plant', str(plant), '--out', out],
    }[command]
    limited = [] if command == 'explain' else ['sh', '-c', SMALL, 'sh']
    done = subprocess.run(
        [*limited, sys.executable, '-m', 'endoscope_bringup.cli', *argv],
        capture_output=True,
        text=True,
        env=os.environ | {'OPENBLAS_NUM_THREADS': '1'},
        check=False,
    )
    if command == 'recover':
        assert 'saved 100 messages' in done.stdout
    else:
        assert done.returncode == 2
        assert 'it claims 2147483648 bytes' in done.stderr.splitlines()[-1]
        assert 'Traceback' not in done.stderr


@pytest.mark.parametrize('kind', KINDS)
def test_spoiled_files_end_in_one_line_or_a_right_answer(kind):
    """A small run of `endoscope bench files`, which tries ten thousand of each kind."""
    found = Outcomes(kind)
    for batch in try_files(kind, 100 if kind in ('mcap', 'weights') else 200, 0, 2):
        found.add(batch)
    assert found.good, found.bad
    assert found.counts['one line']
    assert found.counts['correct']
