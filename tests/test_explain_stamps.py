"""Recordings whose header stamps are those of no clock or of another one."""

import numpy as np
import pytest
from short_bags import PLANT, write_short_bag

from endoscope_bringup import cli
from endoscope_core.physics import save_plant
from endoscope_explain.recording import recording_from_bag


@pytest.fixture
def explain(tmp_path, capsys):
    save_plant(PLANT, tmp_path / 'plant.yaml')

    def explain(restamped):
        bag = write_short_bag(tmp_path / 'bag', duration=1.5, restamped=restamped)
        plant, out = tmp_path / 'plant.yaml', tmp_path / 'out'
        words = ['explain', str(bag), '--plant', str(plant), '--out', str(out), '--quick']
        return cli.main(words), capsys.readouterr()

    return explain


TOPICS = ['slave/measured_js', 'wires/measured_js', 'motor/measured_js', 'motor/servo_jp']


@pytest.mark.parametrize(
    ('topic', 'restamped', 'words'),
    [
        ('slave/measured_js', lambda at: 0 * at, 'are stamped 0.000 s'),
        ('wires/measured_js', lambda at: 0 * at + 17 * 10**17, 'are stamped 1700000000.000 s'),
        ('motor/measured_js', lambda at: at + 3600 * 10**9, 'by one clock'),
        ('motor/servo_jp', lambda at: at - 1_699_999_000 * 10**9, 'by one clock'),
    ],
)
def test_stamps_that_are_times_of_nothing_or_of_another_clock_are_refused(
    explain, tmp_path, topic, restamped, words
):
    status, printed = explain({topic: restamped})
    assert status == 2
    assert printed.err.count('\n') == 1
    assert f'/rig/{topic}' in printed.err
    assert words in printed.err
    assert not (tmp_path / 'out').exists()


def first_two_zero(stamps):
    """As of a driver that publishes before its clock is set."""
    return np.where(np.arange(len(stamps)) < 2, 0, stamps)


@pytest.mark.engine
def test_stray_stamps_are_left_out_and_noted(explain):
    status, printed = explain({'slave/measured_js': first_two_zero})
    assert status == 0
    assert 'note: 2 of 60 messages of /rig/slave/measured_js are left out' in printed.err


@pytest.mark.parametrize('topic', TOPICS)
def test_any_topic_may_have_stray_stamps(tmp_path, topic):
    whole = recording_from_bag(write_short_bag(tmp_path / 'whole'), PLANT)
    bag = write_short_bag(tmp_path / 'bag', restamped={topic: first_two_zero})
    recording = recording_from_bag(bag, PLANT)
    (note,) = recording.notes
    assert note.startswith('2 of ')
    assert f'/rig/{topic} are left out' in note
    assert recording.duration == pytest.approx(whole.duration, abs=0.01)
    for name, series in {'command': whole.command, **whole.measured()}.items():
        found = recording.command if name == 'command' else recording.measured()[name]
        lost = 2 if series.topic == topic else 0
        assert len(found.time) == len(series.time) - lost
