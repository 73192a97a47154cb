"""Every command with arguments that cannot be used: one line, exit 2, no defect."""

import argparse
import contextlib
import itertools

import numpy as np
import pytest
from short_bags import PLANT, write_short_bag

from endoscope_bringup.cli import build_parser, main
from endoscope_core.physics import save_plant

CALLED = {
    'bench',
    'demo',
    'operate',
    'teleop',
    'topics',
    'record',
    'replay',
    'console',
    'doctor',
}
"""Those that run, listen or wait whatever the files: only their numbers are tried."""
FILES = ('missing', 'folder', 'empty', 'random', 'nan.csv')
NUMBERS = ('nan', 'x', '1e400', '-1', '-1e300', f'{10**300}')
BLOCKED = ('random/below', '/proc/bag')
"""Outputs that nobody can write, root neither: below a file, and in a folder of the kernel's."""
MAPPING = """
time: {column: time, unit: s}
topics: {slave/measured_js: {position: {bend_x: {column: angle, unit: rad}}}}
"""
WRITING = (
    'simulate --plant plant.yaml --commands bag --out',
    'explain bag --plant plant.yaml --quick --out',
    'convert table.csv --mapping mapping.yaml --out',
    'convert table.csv --propose',
    'bag cut bag --out',
    'bag recover bag',
    'dataset --n 7 --out',
    'identify bag --model dahl --out',
)
READING = (
    'explain bag --plant plant.yaml --quick --out out --baseline',
    'explain bag --plant plant.yaml --quick --out out --validate',
    'convert table.csv --out out --mapping',
    'console --rig',
)
PROGRESS = ('reading the table', 'slave/measured_js')
"""What `convert` says first of what it is at."""
_NO_NUMBER = (None, str)


def leaves(parser, path=()):
    """Yield all commands of a parser, those of commands too, as words and parser."""
    nested = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    if not nested:
        yield path, parser
    for action in nested:
        for name, child in action.choices.items():
            yield from leaves(child, (*path, name))


COMMANDS = dict(leaves(build_parser()))


def required(parser, value, out):
    """Arguments that a command wants, each with the same value; what it writes goes to `out`."""
    words = []
    for action in parser._actions:
        if action.required or (not action.option_strings and action.nargs not in ('?', '*')):
            given = next(iter(action.choices)) if action.choices else value
            given = out if action.dest == 'out' else given
            words += [*action.option_strings[-1:], str(given)]
    return words


@pytest.fixture
def hostile(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'folder').mkdir()
    (tmp_path / 'empty').touch()
    (tmp_path / 'random').write_bytes(np.random.default_rng(0).bytes(5000))
    (tmp_path / 'nan.csv').write_text('time,bend_x\n0,nan\nnan,inf\n')
    return tmp_path


def ends_in_one_line(words, capsys, beside=()):
    """Call a command; whether it refused, with one line that says no defect."""
    try:
        status = main([str(word) for word in words])
    except SystemExit as stop:
        status = stop.code
    said = [line for line in capsys.readouterr().err.splitlines() if line not in beside]
    assert 'defect' not in ' '.join(said), (words, said)
    assert (status, len(said)) == (2, 1), (words, status, said)


@pytest.mark.parametrize('path', [p for p in COMMANDS if p[0] not in CALLED], ids=' '.join)
def test_files_that_cannot_be_used_are_one_line(path, hostile, capsys):
    takes_files = any(a.required and a.dest != 'out' for a in COMMANDS[path]._actions)
    for kind in FILES if takes_files else ():
        words = [*path, *required(COMMANDS[path], hostile / kind, hostile / 'out')]
        if path == ('completion',) or (path == ('convert',) and kind == 'nan.csv'):
            continue  # the one takes no file, the other only says what is in the table
        if path == ('identify',):
            words += ['--model', 'bouc_wen']
        ends_in_one_line(words, capsys)
        assert not (hostile / 'out').exists()


@pytest.mark.parametrize('path', COMMANDS, ids=' '.join)
def test_numbers_that_are_none_are_one_line(path, hostile, capsys):
    parser = COMMANDS[path]
    numeric = [a for a in parser._actions if a.option_strings and is_number(a)]
    # Options share their types: each gets a third of the numbers, and each number many options.
    for k, number in itertools.product(range(len(numeric)), NUMBERS):
        if (k + NUMBERS.index(number)) % 3:
            continue
        action = numeric[k]
        words = [*path, *required(parser, hostile / 'missing', hostile / 'out')]
        ends_in_one_line([*words, f'{action.option_strings[-1]}={number}'], capsys)


@pytest.fixture(scope='module')
def sound(tmp_path_factory):
    """A folder with a plant, a bag, a table and its mapping that can be used."""
    folder = tmp_path_factory.mktemp('sound')
    save_plant(PLANT, folder / 'plant.yaml')
    write_short_bag(folder / 'bag')
    (folder / 'table.csv').write_text('time,angle\n' + '0.1,0.5\n0.2,0.6\n')
    (folder / 'mapping.yaml').write_text(MAPPING)
    return folder


@pytest.mark.engine
@pytest.mark.parametrize(
    'blocked', [BLOCKED[0], pytest.param(BLOCKED[1], marks=pytest.mark.nightly)]
)
@pytest.mark.parametrize('words', WRITING)
def test_outputs_that_cannot_be_written_are_one_line(words, blocked, hostile, sound, capsys):
    with contextlib.chdir(sound):
        ends_in_one_line([*words.split(), hostile / blocked], capsys, beside=PROGRESS)


@pytest.mark.parametrize('kind', FILES[:-1])
@pytest.mark.parametrize('words', READING)
def test_optional_files_that_cannot_be_used_are_one_line(words, kind, hostile, sound, capsys):
    with contextlib.chdir(sound):
        ends_in_one_line([*words.split(), hostile / kind], capsys)


def is_number(action):
    """Whether an option takes a number: its type refuses a word."""
    if action.type in _NO_NUMBER:
        return False
    try:
        action.type('x')
    except (ValueError, TypeError, argparse.ArgumentTypeError):
        return True
    return False
