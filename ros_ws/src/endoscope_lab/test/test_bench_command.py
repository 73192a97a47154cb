"""`endoscope bench`, as the program finds it in an installed package."""

import pytest

from endoscope_bringup.cli import main
from endoscope_lab.commands import BENCHES


@pytest.mark.parametrize('name', BENCHES)
def test_every_bench_has_help(name, capsys):
    with pytest.raises(SystemExit) as stop:
        main(['bench', name, '--help'])
    assert stop.value.code == 0
    assert f'usage: endoscope bench {name}' in capsys.readouterr().out
