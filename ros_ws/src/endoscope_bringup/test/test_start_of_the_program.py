"""Help, version and completion cost next to nothing: nothing heavy is loaded for them."""

import os
import re
import subprocess
import sys

import pytest

from endoscope_bringup import cli
from endoscope_bringup.commands import COMMANDS
from endoscope_bringup.subcommands import GROUP, commands_of_other_packages

HEAVY = ('torch', 'numpy', 'scipy', 'numba', 'rclpy', 'matplotlib', 'mcap')
CODE = """
import sys
from endoscope_bringup.cli import main
try:
    main(sys.argv[1:])
finally:
    print('loaded:', *[name for name in {heavy} if name in sys.modules], file=sys.stderr)
"""


# A module of a command, and the metadata by which Python finds it.
BREW = """
def add_parser(subparsers):
    subparsers.add_parser('brew', help='make tea').add_argument('sort')
def run(args):
    import brewed
    print(args.sort, brewed.WORD)
    return 0
"""

ENTRY_POINTS = f"""
[console_scripts]
brew = kitchen:main

[{GROUP}]
brew = kitchen_brew

[other]
a = b
"""


def start(*words, path=''):
    return subprocess.run(
        [sys.executable, '-c', CODE.format(heavy=HEAVY), *words],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, 'PYTHONPATH': f'{path}{os.pathsep}{os.environ.get("PYTHONPATH", "")}'},
    )


@pytest.fixture
def kitchen(tmp_path):
    """An installed package with a command."""
    (tmp_path / 'kitchen_brew.py').write_text(BREW)
    (tmp_path / 'brewed.py').write_text("WORD = 'tea'")
    (tmp_path / 'kitchen-1.0.dist-info').mkdir()
    (tmp_path / 'kitchen-1.0.dist-info/METADATA').write_text('Name: kitchen\nVersion: 1.0\n')
    (tmp_path / 'kitchen-1.0.dist-info/entry_points.txt').write_text(ENTRY_POINTS)
    return tmp_path


def test_help_loads_nothing_heavy():
    commands = [*COMMANDS, *commands_of_other_packages()]
    names = [name.rstrip('_').replace('_', '-') for name in commands]
    # One program shows them all: what loads nothing after another one loads nothing alone.
    code = (
        'import sys\n'
        'from endoscope_bringup.cli import main\n'
        f'for words in {[[], *([name] for name in names)]}:\n'
        '    try:\n'
        "        main([*words, '--help'])\n"
        '    except SystemExit as stop:\n'
        '        assert stop.code == 0, words\n'
        f'print([name for name in {HEAVY} if name in sys.modules], file=sys.stderr)\n'
    )
    shown = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False
    )
    assert (shown.returncode, shown.stderr) == (0, '[]\n')
    for name in names:
        assert f'usage: endoscope {name} ' in shown.stdout
    assert shown.stdout.count('usage: endoscope ') == len(names) + 1


@pytest.mark.parametrize(
    'module',
    [
        'endoscope_bringup.operating.actions',
        'endoscope_bringup.operating.listening',
        'endoscope_nodes.healthcheck',
    ],
)
def test_what_only_asks_a_graph_loads_nothing_that_computes(module):
    code = (
        'import importlib, sys\n'
        f'importlib.import_module({module!r})\n'
        "print(*sorted({'numba', 'scipy'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_the_version_is_that_of_the_package():
    shown = start('--version')
    assert re.fullmatch(r'endoscope \d+\.\d+\.\d+\n', shown.stdout)
    assert shown.stderr == 'loaded:\n'


def test_a_package_that_is_installed_adds_its_command(kitchen):
    shown = start('--help', path=kitchen)
    assert 'make tea' in shown.stdout
    assert shown.stderr == 'loaded:\n'
    assert start('brew', 'green', path=kitchen).stdout == 'green tea\n'
    assert 'brew' not in start('--help').stdout


def test_without_the_lab_there_is_no_bench_and_one_line_says_so(monkeypatch, capsys):
    monkeypatch.setattr(cli, 'commands_of_other_packages', dict)
    with pytest.raises(SystemExit) as stop:
        cli.main(['bench', 'graph', '--seconds', '3'])
    assert stop.value.code == 2
    output = capsys.readouterr().err
    assert 'endoscope_lab' in output
    assert output.count('\n') == 1
    assert 'bench' not in cli.build_parser().format_help()


@pytest.mark.parametrize('shell', ['bash', 'zsh', 'tcsh'])
def test_a_shell_completes_every_command(shell):
    script = start('completion', shell).stdout
    assert all(name.rstrip('_').replace('_', '-') in script for name in COMMANDS)


def test_bash_completes_a_command():
    script = start('completion', 'bash').stdout
    typed = 'COMP_WORDS=(endoscope tele); COMP_CWORD=1; _shtab_endoscope; echo "${COMPREPLY[@]}"'
    shown = subprocess.run(
        ['bash', '-c', f'{script}\n{typed}'], capture_output=True, text=True, check=False
    )
    assert shown.stdout.split() == ['teleop'], shown.stderr


@pytest.mark.parametrize(('level', 'shows_it'), [('info', True), ('error', False)])
def test_the_level_of_the_log_holds_for_the_nodes_of_a_command(tmp_path, level, shows_it):
    begun = (
        'import sys; from endoscope_nodes.runtime.runtime import Runtime; '
        'Runtime.spin = lambda runtime: None; '
        'from endoscope_bringup.cli import main; sys.exit(main(sys.argv[1:]))'
    )
    shown = subprocess.run(
        [sys.executable, '-c', begun, '--log-level', level, 'record', '--out', tmp_path / 'bag'],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ('recording to' in shown.stderr) is shows_it, shown.stderr
