import sys

import pytest

from endoscope_bringup.cli import main
from endoscope_lab.papers.row import Row, table_text


def test_a_row_prints_the_papers_figure_beside_ours():
    text = table_text([Row('RMSE, deg', (1.0, 3.0), '4.65 ± 0.13', at_most=2.5, note='simulated')])
    header, line, note = text.splitlines()
    assert header.split()[:2] == ['figure', 'paper']
    assert '4.65 ± 0.13' in line
    assert '2.00 ± 1.00' in line
    assert line.endswith('kept')
    assert note.strip() == 'simulated'


@pytest.mark.parametrize(
    ('aims', 'reached'),
    [
        ({}, None),
        ({'at_least': 2.0}, True),
        ({'at_least': 2.1}, False),
        ({'at_least': 1.0, 'at_most': 1.9}, False),
    ],
)
def test_the_mean_is_what_is_judged(aims, reached):
    assert Row('x', (1.0, 3.0), **aims).reached is reached


def test_what_is_not_finite_keeps_no_aim():
    assert Row('x', (1.0, float('nan')), at_most=9.0).reached is False


def test_too_few_tubes_are_refused(capsys):
    assert main(['bench', 'papers', '--tubes', '2']) == 2
    assert 'at least 5' in capsys.readouterr().err


@pytest.mark.parametrize(
    'command',
    [
        ['bench', 'papers'],
        ['bench', 'papers', '--only', 'classifiers'],
    ],
)
def test_without_pytorch_one_line_says_how_to_get_it(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, 'torch', None)
    for name in (
        'endoscope_lab.papers.networks',
        'endoscope_lab.training.network',
    ):
        monkeypatch.delitem(sys.modules, name, raising=False)
    assert main(command) == 2
    assert capsys.readouterr().err == (
        'endoscope: training the networks of the first paper needs PyTorch: run '
        '`make -C ros_ws train`, which says how large it is\n'
    )
    assert list(tmp_path.iterdir()) == []
