"""Help, version and completion cost next to nothing: nothing heavy is loaded for them."""

import re
import subprocess
import sys

import pytest

from endoscope_bringup.commands import COMMANDS

HEAVY = ('numpy', 'scipy', 'numba', 'rclpy', 'matplotlib', 'mcap', 'sklearn')
CODE = """
import sys
from endoscope_bringup.cli import main
try:
    main(sys.argv[1:])
finally:
    print('loaded:', *[name for name in {heavy} if name in sys.modules], file=sys.stderr)
"""


def start(*words):
    return subprocess.run(
        [sys.executable, '-c', CODE.format(heavy=HEAVY), *words],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize('command', [*COMMANDS, ''])
def test_help_loads_nothing_heavy(command):
    name = command.rstrip('_').replace('_', '-')
    shown = start(*([name] if name else []), '--help')
    assert shown.returncode == 0
    assert shown.stdout.startswith('usage: endoscope')
    assert shown.stderr == 'loaded:\n'


def test_the_version_is_that_of_the_package():
    shown = start('--version')
    assert re.fullmatch(r'endoscope \d+\.\d+\.\d+\n', shown.stdout)
    assert shown.stderr == 'loaded:\n'


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


@pytest.mark.parametrize(('level', 'said'), [('info', True), ('error', False)])
def test_the_level_of_the_log_holds_for_the_nodes_of_a_command(tmp_path, level, said):
    begun = (
        'import sys; from endoscope_nodes.runtime import Runtime; '
        'Runtime.spin = lambda runtime: None; '
        'from endoscope_bringup.cli import main; sys.exit(main(sys.argv[1:]))'
    )
    shown = subprocess.run(
        [sys.executable, '-c', begun, '--log-level', level, 'record', '--out', tmp_path / 'bag'],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ('recording to' in shown.stderr) is said, shown.stderr
