"""A stretch of a recording, with what was in force when it began."""

import pytest

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr import encode_string
from endoscope_bags.copying import cut
from endoscope_bags.errors import BagError, BagExistsError
from endoscope_bags.information import bag_information
from endoscope_bags.message_types import STRING
from endoscope_bags.topic import COMMAND_QOS, LATCHED_QOS

MS = 10**6


@pytest.fixture
def bag(tmp_path):
    """Two seconds of a stream that loses its 1500th message, and a state that changes twice."""
    with BagWriter(tmp_path / 'bag') as writer:
        writer.add_topic('/state', STRING, [LATCHED_QOS])
        writer.add_topic('/stream', STRING, [COMMAND_QOS])
        for k in range(2001):
            if k in (0, 700):
                state = encode_string(f'from {k}')
                writer.write_raw('/state', STRING, state, k * MS, k * MS, 1 + k // 700)
            if k != 1500:
                writer.write_raw('/stream', STRING, encode_string(str(k)), k * MS, k * MS, k + 1)
        writer.close({'lost /state': '0', 'lost /stream': '1'})
    return tmp_path / 'bag'


def text(message):
    return message.data[8:].rstrip(b'\0').decode()


def test_the_stretch_and_what_was_in_force_are_kept(bag, tmp_path):
    report = cut(bag, tmp_path / 'out', 0.8, 1.2)
    assert str(report) == '401 messages over 0.400 s; in force at its beginning: /state'
    out = open_bag(tmp_path / 'out')
    first, *rest = out.messages()
    assert (first.topic, text(first), first.log_ns) == ('/state', 'from 700', 800 * MS)
    assert [text(m) for m in rest] == [str(k) for k in range(800, 1201)]
    assert [m.log_ns for m in rest] == [k * MS for k in range(800, 1201)]
    assert [m.sequence for m in rest] == [k + 1 for k in range(800, 1201)]
    assert out.topics['/state'].qos == (LATCHED_QOS,)
    assert out.topics['/stream'].qos == (COMMAND_QOS,)


@pytest.mark.parametrize(('begin', 'end', 'lost'), [(0.0, 1.2, 0), (1.2, None, 1)])
def test_losses_in_the_cut_are_reported(bag, tmp_path, begin, end, lost):
    cut(bag, tmp_path / 'out', begin, end)
    topics = {t.name: t for t in bag_information(open_bag(tmp_path / 'out')).topics}
    assert topics['/stream'].lost == lost
    assert topics['/state'].lost == 0


@pytest.mark.parametrize(('begin', 'end'), [(-1.0, 1.0), (1.0, 1.0), (1.2, 0.3), (2.5, None)])
def test_a_stretch_that_there_is_not_is_refused_and_leaves_nothing(bag, tmp_path, begin, end):
    with pytest.raises(BagError, match=r'has no stretch from .* it is 2\.000 s long'):
        cut(bag, tmp_path / 'out', begin, end)
    assert [p.name for p in tmp_path.iterdir()] == ['bag']


def test_nothing_is_overwritten(bag):
    with pytest.raises(BagExistsError):
        cut(bag, bag, 0.0, 1.0)
