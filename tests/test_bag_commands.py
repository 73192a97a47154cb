"""`endoscope bag info`, `endoscope bag recover` and `endoscope bag list`."""

import json
import re

import pytest

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr import encode_string
from endoscope_bags.event_bag import FAULT, MARK, EventBag, new_event_bag
from endoscope_bags.message_types import STRING
from endoscope_bags.recent_messages import RecentMessages
from endoscope_bags.recording_session import Arrival, RecordingSession
from endoscope_bringup.cli import main

MS = 10**6
START = 1_790_000_000 * 10**9
REASON = 'tension of wire_x_pos is 41.2 N: more\nthan 40 N'


@pytest.fixture
def bag(tmp_path):
    with BagWriter(tmp_path / 'bag.mcap', chunk_seconds=0.1) as writer:
        for k in range(1000):
            writer.write_raw('/a', STRING, encode_string(str(k)), k * MS, k * MS, k + 1)
    return tmp_path / 'bag.mcap'


def test_info_is_printed_and_as_json_has_numbers(bag, capsys):
    assert main(['bag', 'info', str(bag)]) == 0
    text = capsys.readouterr().out
    assert '1000 messages over 0.999 s' in text
    assert '/a' in text
    assert main(['bag', 'info', '--json', str(bag)]) == 0
    information = json.loads(capsys.readouterr().out)
    assert information['message_count'] == 1000
    [topic] = information['topics']
    assert topic['name'] == '/a'
    assert topic['rate_hz'] == pytest.approx(1000.0)
    assert (topic['pauses'], topic['gaps'], topic['lost']) == (0, 0, 0)


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


def bag_of_a_fault(folder):
    """A recording of 5 s whose fault is followed by a mark."""
    recent = RecentMessages(1.0, 10**8)

    def message(k):
        at = START + k * MS
        return Arrival(at, 0, k + 1, at, encode_string(str(k)))

    def opened(records):
        session = RecordingSession(new_event_bag(folder, FAULT, 50), records=records)
        session.add_topic('/stream', STRING)
        return session

    for k in range(5000):
        recent.add([message(k)], set(), START + k * MS)
    event = EventBag(recent, FAULT, START + 4999 * MS)
    event.explain(REASON)
    event.begin(opened)
    event.add(MARK, START + 5001 * MS, 'seen by the operator')
    return event.close().path


def test_the_list_shows_faults_with_time_and_reason(tmp_path, capsys):
    path = bag_of_a_fault(tmp_path)
    with BagWriter(tmp_path / 'plain.mcap') as writer:
        writer.write_raw('/stream', STRING, encode_string('x'), START - 10**9)
    writer = BagWriter(tmp_path / 'live', atomic=False, chunk_seconds=0.0)
    assert main(['bag', 'list', str(tmp_path)]) == 0
    assert 'being recorded' in capsys.readouterr().out
    for k in range(3):
        writer.write_raw('/stream', STRING, encode_string('x'), START + 10**10 + k)
    (tmp_path / 'notes.txt').write_text('no recording')
    (tmp_path / 'broken.mcap').write_text('no recording either')
    assert main(['bag', 'list', str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith('broken.mcap')
    assert 'not an MCAP recording' in lines[1] or 'text, no recording' in lines[1]
    assert lines[2].startswith('recording  2026-09-21T14:13:19 UTC')
    assert lines[2].endswith('plain.mcap')
    assert lines[3].startswith('fault')
    assert lines[3].endswith(path.name)
    assert 'fault at 2026-09-21T14:13:24.999' in lines[4]
    assert 'tension of wire_x_pos' in lines[4]
    assert 'mark at' in lines[5]
    assert re.match('recording  2026-09-21T14:13:30 UTC .* live', lines[6])
    assert lines[7:] == ['    being recorded']
    assert main(['bag', 'list', str(tmp_path), '--json']) == 0
    listed = json.loads(capsys.readouterr().out)
    writer.discard()
    assert listed[2]['events'][0] == {'kind': 'fault', 'at_ns': START + 4999 * MS, 'reason': REASON}


def test_a_folder_without_recordings_and_none_at_all(tmp_path, capsys):
    assert main(['bag', 'list', str(tmp_path)]) == 0
    assert capsys.readouterr().out == f'{tmp_path}: no recording\n'
    assert main(['bag', 'list', str(tmp_path / 'none')]) == 2
    assert 'no such folder' in capsys.readouterr().err
