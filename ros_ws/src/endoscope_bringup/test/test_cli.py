"""The program's promises about exit statuses and error lines, with the real parser."""

import argparse
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from endoscope_bringup import cli
from endoscope_bringup.commands import COMMANDS
from endoscope_bringup.subcommands import OneLineParser
from endoscope_core.atomic_output import atomic_file, write_text
from endoscope_core.errors import EndoscopeError

HEAVY_MODULES = {'torch', 'rclpy', 'numba', 'scipy', 'matplotlib', 'sklearn', 'distributed'}


def _parser_running(action: Callable[[argparse.Namespace], int]) -> Callable[[], OneLineParser]:
    def build() -> OneLineParser:
        parser = OneLineParser(prog='endoscope')
        parser.set_defaults(run_command=action, log_level=None)
        return parser

    return build


@pytest.mark.parametrize('argv', [[], ['no-such-command'], ['bag'], ['bag', 'no-such-look']])
def test_wrong_usage_is_one_line_and_exit_2(
    argv: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(argv)
    assert stop.value.code == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.startswith('endoscope')
    assert '--help' in err
    assert err.count('\n') == 1


@pytest.mark.parametrize('command', COMMANDS)
def test_every_command_has_help(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main([command.rstrip('_').replace('_', '-'), '--help'])
    assert stop.value.code == 0
    assert 'usage: endoscope' in capsys.readouterr().out


def test_unusable_input_is_one_line_and_exit_2(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(_args: argparse.Namespace) -> int:
        raise EndoscopeError("plant.yaml: unknown key 'gian'\nthe nearest is 'gain'")

    monkeypatch.setattr(cli, 'build_parser', _parser_running(refuse))
    assert cli.main([]) == 2
    assert capsys.readouterr().err == (
        "endoscope: plant.yaml: unknown key 'gian' the nearest is 'gain'\n"
    )


def test_missing_file_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    missing = tmp_path / 'missing.mcap'
    monkeypatch.setattr(
        cli, 'build_parser', _parser_running(lambda _args: len(missing.read_bytes()))
    )
    assert cli.main([]) == 2
    assert capsys.readouterr().err == f'endoscope: {missing}: No such file or directory\n'


def test_defect_keeps_its_traceback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli, 'build_parser', _parser_running(lambda _args: 1 // 0))
    with pytest.raises(ZeroDivisionError):
        cli.main([])


@pytest.mark.parametrize(('signum', 'status'), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signal_gives_its_status_and_leaves_no_output(
    signum: signal.Signals, status: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def write(_args: argparse.Namespace) -> int:
        with atomic_file(tmp_path / 'report.html') as partial:
            partial.write_text('half')
            os.kill(os.getpid(), signum)
        return 0

    monkeypatch.setattr(cli, 'build_parser', _parser_running(write))
    # A shell starts what runs in the background with SIGINT ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        result = cli.main([])
    except SystemExit as stop:
        result = stop.code
    finally:
        signal.signal(signal.SIGINT, before)
    assert result == status
    assert list(tmp_path.iterdir()) == []


def test_help_imports_nothing_heavy() -> None:
    program = (
        'import sys\n'
        'from endoscope_bringup.cli import build_parser\n'
        'build_parser()\n'
        f'print(*sorted(set(sys.modules) & {HEAVY_MODULES!r}))\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=False
    )
    assert done.stderr == ''
    assert done.stdout.strip() == ''


def test_closed_pipe_is_no_traceback(tmp_path: Path) -> None:
    script = tmp_path / 'print_a_lot.py'
    write_text(
        script,
        'import sys\n'
        'from endoscope_bringup import cli\n'
        'from endoscope_bringup.subcommands import OneLineParser\n'
        'def run(args):\n'
        '    for _ in range(100000):\n'
        "        print('line')\n"
        '    return 0\n'
        "parser = OneLineParser(prog='endoscope')\n"
        'parser.set_defaults(run_command=run, log_level=None)\n'
        'cli.build_parser = lambda: parser\n'
        'sys.exit(cli.main([]))\n',
    )
    pipeline = f'{sys.executable} {script} | head -n 1'
    done = subprocess.run(['bash', '-c', pipeline], capture_output=True, text=True, check=False)
    assert done.stdout == 'line\n'
    assert done.stderr == ''
