import sys

from endoscope_bringup.cli import main


def test_too_few_tubes_are_refused(capsys):
    assert main(['bench', 'papers', '--tubes', '2']) == 2
    assert 'at least 5' in capsys.readouterr().err


def test_without_pytorch_one_line_says_how_to_get_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, 'torch', None)
    for name in (
        'endoscope_lab.papers.networks',
        'endoscope_lab.training.network',
    ):
        monkeypatch.delitem(sys.modules, name, raising=False)
    assert main(['bench', 'papers', '--only', 'classifiers']) == 2
    assert capsys.readouterr().err == (
        'endoscope: training the networks of the first paper needs PyTorch: run '
        '`make -C ros_ws train`, which says how large it is\n'
    )
    assert list(tmp_path.iterdir()) == []
