"""The rig that a recording carries, whatever becomes of the recording."""

from dataclasses import replace

import pytest

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr import encode_string
from endoscope_bags.copying import cut, recover
from endoscope_bags.message_types import STRING
from endoscope_bags.recording import rig_of_bag, rig_record
from endoscope_core.errors import FileError
from endoscope_core.rig import shipped_rig

MS = 10**6
RIG = replace(shipped_rig(), joints=replace(shipped_rig().joints, gear=0.53))


def write(path, records):
    with BagWriter(path, records=records) as writer:
        writer.add_topic('/stream', STRING)
        for k in range(1000):
            writer.write_raw('/stream', STRING, encode_string(str(k)), k * MS, k * MS, k + 1)
    return path


@pytest.fixture
def bag(tmp_path):
    return write(tmp_path / 'bag.mcap', rig_record(RIG))


def test_it_is_read_as_it_was_written(bag):
    assert rig_of_bag(open_bag(bag)) == RIG


def test_a_recording_that_carries_none_is_of_the_shipped_rig(tmp_path):
    assert rig_of_bag(open_bag(write(tmp_path / 'bag.mcap', None))) == shipped_rig()


def test_a_stretch_of_the_recording_has_it(bag, tmp_path):
    cut(bag, tmp_path / 'stretch', 0.2, 0.4)
    assert rig_of_bag(open_bag(tmp_path / 'stretch')) == RIG


def test_a_recorder_that_was_killed_has_left_it(bag, tmp_path):
    broken = tmp_path / 'broken.mcap'
    broken.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    recover(broken, tmp_path / 'saved')
    assert rig_of_bag(open_bag(tmp_path / 'saved')) == RIG


def test_a_rig_that_is_none_is_named_with_its_recording(tmp_path):
    bag = write(tmp_path / 'bag.mcap', {'endoscope_rig': {'rig.yaml': 'joints: {gearing: 0.6}'}})
    with pytest.raises(FileError, match=r'the rig of .*bag\.mcap.*gearing.*gear'):
        rig_of_bag(open_bag(bag))
