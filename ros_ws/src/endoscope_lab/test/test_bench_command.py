"""`endoscope bench`, as the program finds it in an installed package."""

import importlib.metadata

import pytest

from endoscope_bringup.cli import main
from endoscope_bringup.subcommands import GROUP
from endoscope_lab.commands import BENCHES


def test_the_package_brings_its_commands():
    entries = importlib.metadata.distribution('endoscope_lab').entry_points
    commands = entries.select(group=GROUP)
    assert {command.name for command in commands} == {'bench', 'dataset', 'fit', 'prove', 'train'}
    assert all(callable(command.load().run) for command in commands)


@pytest.mark.parametrize('words', [[], ['no-such-bench']])
def test_wrong_usage_is_one_line_and_exit_2(words, capsys):
    with pytest.raises(SystemExit) as stop:
        main(['bench', *words])
    assert stop.value.code == 2
    assert capsys.readouterr().err.count('\n') == 1


@pytest.mark.parametrize('name', BENCHES)
def test_every_bench_has_help(name, capsys):
    with pytest.raises(SystemExit) as stop:
        main(['bench', name, '--help'])
    assert stop.value.code == 0
    assert f'usage: endoscope bench {name}' in capsys.readouterr().out
