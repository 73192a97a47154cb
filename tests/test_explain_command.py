"""`endoscope explain` from bags to reports: what it writes, and what it refuses."""

import csv
import hashlib
import html
import json
from dataclasses import replace

import numpy as np
import pytest
from short_bags import PLANT, write_short_bag

from endoscope_bringup import cli
from endoscope_core.physics import EffectSpec, JointParameters, load_plant, save_plant


@pytest.fixture
def rig(tmp_path_factory, corpus):
    """A folder with a plant file, a sound bag and one of a rig with an end stop."""
    folder = tmp_path_factory.mktemp('rig')
    save_plant(PLANT, folder / 'plant.yaml')
    for name in ('sound', 'stopped'):
        (folder / f'{name}.mcap').symlink_to(corpus.bag(name))
    return folder


def explain(rig, out, *arguments):
    return cli.main(
        ['explain', *map(str, arguments), '--plant', str(rig / 'plant.yaml'), '--out', str(out)]
    )


def test_a_stop_is_named_shown_and_exported(rig, tmp_path, capsys):
    out = tmp_path / 'out'
    assert explain(rig, out, rig / 'stopped.mcap', '--validate', rig / 'stopped.mcap') == 0
    printed = capsys.readouterr()
    first, *rest = printed.out.splitlines()
    assert first.startswith('The simulation leaves out joint_stop on bend_x.')
    assert any(line.startswith('    angle_deg 6.') for line in rest)
    assert rest[-1] == f'Report: {out / "report.html"}'
    assert 'refitting the nominal plant' in printed.err
    report = json.loads((out / 'report.json').read_text())
    assert report['verdict'] == 'missing_physics'
    (effect,) = report['effects']
    assert effect['id'] == 'joint_stop'
    angle = effect['parameters']['angle_rad']
    assert angle['value'] == pytest.approx(0.12, rel=0.05)
    wire = 'wires/measured_js:wire_x_pos'
    for fit in (report['fit'], report['fit']['validation']):
        assert fit['augmented'][wire]['rmse_over_noise'] < 1.15
    (place,) = report['where']
    assert place['stage'] == 'joint'
    assert [e.id for e in load_plant(out / 'plant.yaml').effects] == ['joint_stop']
    page = (out / 'report.html').read_text()
    assert '<h1>The simulation leaves out physics</h1>' in page
    # What the page was made from is said by their hashes.
    for file in (rig / 'stopped.mcap', rig / 'plant.yaml'):
        assert hashlib.sha256(file.read_bytes()).hexdigest() in page
    assert html.escape(f'endoscope explain {rig / "stopped.mcap"}') in page


def summary(out):
    with (out / 'summary.csv').open(newline='') as file:
        return {row['bag']: row['verdict'] for row in csv.DictReader(file)}


def test_many_bags_have_one_report_each_and_one_table(rig, tmp_path, capsys):
    other = tmp_path / 'other' / 'sound.mcap'
    other.parent.mkdir()
    other.write_bytes((rig / 'sound.mcap').read_bytes())
    bags = (rig / 'sound.mcap', other)
    assert explain(rig, tmp_path / 'out', *bags, '--quick', '--jobs', '2', '--json') == 0
    assert summary(tmp_path / 'out') == {'sound': 'consistent', 'sound_2': 'consistent'}
    for name in ('sound', 'sound_2'):
        assert (tmp_path / 'out' / name / 'report.html').is_file()
    said = capsys.readouterr()
    assert '2/2' in said.err
    lines = json.loads(said.out)
    assert [(line['bag'], line['verdict']) for line in lines] == [
        ('sound', 'consistent'),
        ('sound_2', 'consistent'),
    ]
    assert all(0.5 < line['augmented_rmse_over_noise'] < 2.0 for line in lines)
    with (tmp_path / 'out' / 'parameters.csv').open(newline='') as file:
        rows = {row['parameter']: row for row in csv.DictReader(file)}
    exponents = [float(rows['capstan_exponent'][name]) for name in ('sound', 'sound_2')]
    assert exponents == pytest.approx([0.9, 0.9], rel=0.05)
    report = json.loads((tmp_path / 'out' / 'sound' / 'report.json').read_text())
    shown = {name for name, e in report['parameters']['bend_x'].items() if e['shown']}
    assert {name for name, row in rows.items() if row['sound']} == shown < set(rows)


@pytest.mark.engine
def test_bags_that_cannot_tell_are_reported_by_a_process_of_its_own(tmp_path):
    save_plant(PLANT, tmp_path / 'plant.yaml')
    bags = [write_short_bag(tmp_path / name, duration=1.0) for name in ('brief', 'short')]
    assert explain(tmp_path, tmp_path / 'out', *bags, '--quick', '--jobs', '1') == 0
    assert summary(tmp_path / 'out') == dict.fromkeys(('brief', 'short'), 'insufficient_data')
    assert (tmp_path / 'out' / 'brief' / 'report.html').is_file()


def test_sound_recordings_of_one_rig_share_no_missing_physics(rig, corpus, tmp_path, capsys):
    out = tmp_path / 'out'
    bags = (corpus.bag('again'), rig / 'sound.mcap')
    assert explain(rig, out, *bags, '--quick', '--same-physics') == 0
    assert summary(out) == {'again': 'consistent', 'sound': 'consistent'}
    assert 'only noise is left beside nothing' in capsys.readouterr().err


def refused(capsys, rig, out, *arguments):
    assert explain(rig, out, *arguments) == 2
    output = capsys.readouterr()
    assert output.err.count('\n') == 1
    assert not out.exists()
    return output.err


@pytest.mark.parametrize('topic', ['motor/servo_jp', 'slave/measured_js'])
def test_a_lacking_topic_is_named(rig, tmp_path, capsys, topic):
    bag = write_short_bag(tmp_path / 'bag', leave_out=topic)
    assert topic in refused(capsys, rig, tmp_path / 'out', bag)


@pytest.mark.nightly
@pytest.mark.engine
def test_a_rig_without_load_cells_is_explained_and_what_cannot_be_told_is_said(tmp_path, capsys):
    save_plant(PLANT, tmp_path / 'plant.yaml')
    bag = write_short_bag(tmp_path / 'bag', leave_out='wires/measured_js')
    assert explain(tmp_path, tmp_path / 'out', bag, '--quick') == 0
    printed = capsys.readouterr()
    assert 'audit: wires/measured_js was not recorded: the torque of the motor alone' in printed.err
    assert printed.out.startswith('The described plant predicts the recording of bend_x.')


def test_the_one_bad_recording_is_named_before_any_work(rig, tmp_path, capsys):
    good, bad = rig / 'sound.mcap', write_short_bag(tmp_path / 'bad', spoil=np.nan)
    message = refused(capsys, rig, tmp_path / 'out', bad)
    assert f'{bad}: topic /rig/slave/measured_js' in message
    assert 'bend_x' in message
    assert str(bad) in refused(capsys, rig, tmp_path / 'out', good, '--validate', bad)
    lacks = write_short_bag(tmp_path / 'lacks', leave_out='slave/measured_js')
    assert 'lacks' in refused(capsys, rig, tmp_path / 'out', good, lacks)


def test_of_two_rigs_in_a_bag_one_has_to_be_chosen(rig, tmp_path, capsys):
    both = write_short_bag(tmp_path / 'both', rigs=('left', 'right'))
    assert 'give the namespace' in refused(capsys, rig, tmp_path / 'out', both)
    assert explain(rig, tmp_path / 'out', both, '--namespace', 'right', '--quick') == 0


def test_joints_that_were_not_recorded_stay_in_the_plant_as_described(corpus, tmp_path):
    load = EffectSpec('external_load', 'bend_y', {'moment_nm': 0.002, 'time_s': 1.0})
    joints = {**PLANT.joints, 'bend_y': JointParameters(pretension=4.5)}
    described = replace(PLANT, joints=joints, effects=(load,))
    save_plant(described, tmp_path / 'plant.yaml')
    assert explain(tmp_path, tmp_path / 'out', corpus.bag('sound'), '--quick') == 0
    improved = load_plant(tmp_path / 'out' / 'plant.yaml')
    assert list(improved.joints) == ['bend_x', 'bend_y']
    assert improved.joints['bend_y'] == joints['bend_y']
    assert improved.effects == described.effects


def test_a_folder_that_holds_something_is_left_alone(rig, tmp_path, capsys):
    (tmp_path / 'kept.txt').write_text('mine')
    assert explain(rig, tmp_path, rig / 'sound.mcap') == 2
    assert 'not empty' in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ['kept.txt']


def test_second_recordings_that_do_not_fit_the_bags_are_refused(rig, tmp_path, capsys):
    sound, out = rig / 'sound.mcap', tmp_path / 'out'
    message = refused(capsys, rig, out, sound, sound, *3 * ('--validate', sound))
    assert '--validate was given 3 times for 2 bags' in message
    options = ('--same-physics', '--baseline', sound)
    message = refused(capsys, rig, out, sound, rig / 'stopped.mcap', *options)
    assert 'same physics and a baseline are mutually exclusive' in message
