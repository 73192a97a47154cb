"""`endoscope bag info` and `endoscope bag recover`."""

import json

import pytest

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr_encoding import encode_string
from endoscope_bags.message_types import STRING
from endoscope_bringup.cli import main

MS = 10**6


@pytest.fixture
def bag(tmp_path):
    with BagWriter(tmp_path / 'bag.mcap', chunk_seconds=0.1) as writer:
        for k in range(1000):
            writer.write_raw('/a', STRING, encode_string(str(k)), k * MS, k * MS, k + 1)
    return tmp_path / 'bag.mcap'


def test_info_is_printed(bag, capsys):
    assert main(['bag', 'info', str(bag)]) == 0
    text = capsys.readouterr().out
    assert '1000 messages over 0.999 s' in text
    assert '/a' in text


def test_a_cut_bag_is_one_line_and_then_recovered(bag, capsys, tmp_path):
    bag.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    out = tmp_path / 'saved'
    assert main(['bag', 'info', str(bag)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert 'ends in the middle' in line
    assert 'endoscope bag recover' in line
    assert main(['bag', 'recover', str(bag), str(out)]) == 0
    saved = open_bag(out).message_count
    assert 0 < saved < 1000
    assert f'saved {saved} messages' in capsys.readouterr().out
    assert main(['bag', 'info', str(out)]) == 0
    assert 'recovered_from: bag.mcap' in capsys.readouterr().out


@pytest.mark.parametrize('action', [['info'], ['recover', 'out']])
def test_what_is_no_bag_is_one_line_and_exit_2(tmp_path, capsys, monkeypatch, action):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'noise').write_bytes(bytes(range(256)))
    command, *rest = action
    assert main(['bag', command, 'noise', *rest]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line == 'endoscope: noise: not an MCAP recording (wrong first bytes)'
    assert [p.name for p in tmp_path.iterdir()] == ['noise']


def test_recover_does_not_overwrite(bag, capsys):
    before = bag.read_bytes()
    assert main(['bag', 'recover', str(bag), str(bag)]) == 2
    assert 'exists already' in capsys.readouterr().err
    assert bag.read_bytes() == before


def test_info_as_json_has_numbers(bag, capsys):
    assert main(['bag', 'info', '--json', str(bag)]) == 0
    information = json.loads(capsys.readouterr().out)
    assert information['message_count'] == 1000
    [topic] = information['topics']
    assert topic['name'] == '/a'
    assert topic['rate_hz'] == pytest.approx(1000.0)
    assert (topic['pauses'], topic['gaps'], topic['lost']) == (0, 0, 0)
