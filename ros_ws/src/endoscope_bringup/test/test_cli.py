"""The program's promises about exit statuses and error lines, with the real parser."""

import os
import signal
import subprocess
import sys

import pytest

from endoscope_bringup import cli
from endoscope_bringup.subcommands import OneLineParser
from endoscope_core.atomic_output import atomic_file, write_text
from endoscope_core.errors import EndoscopeError


def _parser_running(action):
    def build():
        parser = OneLineParser(prog='endoscope')
        parser.set_defaults(run_command=action, log_level=None)
        return parser

    return build


@pytest.mark.parametrize('argv', [[], ['no-such-command'], ['bag'], ['bag', 'no-such-look']])
def test_wrong_usage_is_one_line_and_exit_2(argv, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(argv)
    assert stop.value.code == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.startswith('endoscope')
    assert '--help' in err
    assert err.count('\n') == 1


def test_unusable_input_is_one_line_and_exit_2(monkeypatch, capsys):
    def refuse(_args):
        raise EndoscopeError("plant.yaml: unknown key 'gian'\nthe nearest is 'gain'")

    monkeypatch.setattr(cli, 'build_parser', _parser_running(refuse))
    assert cli.main([]) == 2
    assert capsys.readouterr().err == (
        "endoscope: plant.yaml: unknown key 'gian' the nearest is 'gain'\n"
    )


def test_missing_file_is_named(monkeypatch, capsys, tmp_path):
    missing = tmp_path / 'missing.mcap'
    monkeypatch.setattr(
        cli, 'build_parser', _parser_running(lambda _args: len(missing.read_bytes()))
    )
    assert cli.main([]) == 2
    assert capsys.readouterr().err == f'endoscope: {missing}: No such file or directory\n'


@pytest.mark.parametrize('level', [(), ('--log-level', 'debug')])
def test_a_defect_is_one_line_that_says_where_and_keeps_its_traceback_for_debug(level, tmp_path):
    # As another package brings a command of its own.
    write_text(
        tmp_path / 'endoscope_other' / 'other.py',
        'def add_parser(subparsers):\n'
        "    subparsers.add_parser('break')\n"
        'def run(args):\n'
        "    {}['alpha']\n",
    )
    (tmp_path / 'other.dist-info').mkdir()
    write_text(
        tmp_path / 'other.dist-info' / 'entry_points.txt',
        '[endoscope.commands]\nbreak = endoscope_other.other\n',
    )
    done = subprocess.run(
        [sys.executable, '-m', 'endoscope_bringup.cli', *level, 'break'],
        env=os.environ | {'PYTHONPATH': str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    *above, line = done.stderr.splitlines()
    assert done.returncode == 2
    assert line == (
        "endoscope: a defect of this program in other.py:4: KeyError: 'alpha'; please report it; "
        '--log-level debug shows the traceback'
    )
    assert ('Traceback (most recent call last):' in above) == bool(level)


@pytest.mark.parametrize(
    ('argv', 'words'),
    [
        ('expain', "unknown 'expain': did you mean explain?"),
        ('operate statu', "unknown 'statu': did you mean status?"),
        ('explain bag --plnat p.yaml', 'unknown option --plnat: did you mean --plant?'),
        ('record --topcs a', 'unknown option --topcs: did you mean --topics?'),
        ('--log-levle debug demo', 'unknown option --log-levle: did you mean --log-level?'),
        ('demo -q', 'unknown option -q: valid are --help, --out'),
    ],
)
def test_the_error_for_a_misspelt_command_or_option_names_the_nearest(argv, words, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(argv.split())
    assert stop.value.code == 2
    [line] = capsys.readouterr().err.splitlines()
    assert words in line


@pytest.mark.parametrize(('signum', 'status'), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signal_gives_its_status_and_leaves_no_output(signum, status, monkeypatch, tmp_path):
    def write(_args):
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


@pytest.mark.parametrize(
    'program',
    [
        'from endoscope_bringup.cli import main; main(["--help"])',
        'from endoscope_bringup.cli import main; main(["effects"])',
        'from endoscope_nodes.program import simulation_clock; simulation_clock(["--help"])',
        'from endoscope_nodes.healthcheck import main; main(["--help"])',
    ],
)
def test_a_reader_that_goes_away_or_has_no_room_gets_no_traceback(program, tmp_path):
    write_text(tmp_path / 'program.py', f'import sys\ntry:\n    {program}\nfinally:\n    pass\n')
    run = f'{sys.executable} {tmp_path / "program.py"}'
    for line, message in (
        # True ends at once, so that the pipe is closed when something is written.
        (f'{{ sleep 0.1; {run}; }} | true', ''),
        (f'{run} >&-', ''),
        (f'{run} 2>&- >&-', ''),
        # What argparse prints, it writes without asking whether there was room.
        *([(f'{run} >/dev/full', 'No space left on device')] if 'effects' in program else []),
    ):
        done = subprocess.run(['bash', '-c', line], capture_output=True, text=True, check=False)
        assert message in done.stderr
        assert len(done.stderr.splitlines()) == bool(message), done.stderr
