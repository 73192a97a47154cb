"""`endoscope investigate` through the real nodes, on a simulated slave."""

import dataclasses
import json

import numpy as np
import pytest
from simulated_graph import TICK_RATE

from endoscope_bags import open_bag
from endoscope_bringup import cli
from endoscope_bringup.demo import live_graph
from endoscope_bringup.demo.live_graph import NODES, LiveGraph
from endoscope_core.errors import NotPlayedError, RigStoppedError
from endoscope_core.names import JOINTS
from endoscope_core.physics import EffectSpec, PlantDescription, save_plant
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import hold, move, sequence
from endoscope_core.signals.sampled_motion import CommandTable, write_command_file
from endoscope_explain.investigation import motions
from endoscope_explain.investigation.motions import RigMotion, held_out, tracked
from endoscope_nodes.client.graph_parameters import read_parameter
from endoscope_nodes.client.motion_player import MotionPlayer
from endoscope_nodes.names import SLAVE_COMMAND
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.runtime.private_domain import private_domain

pytestmark = pytest.mark.engine

LARGEST = 0.5


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Less of a motion shows, too, by which plant the tip follows better."""
    monkeypatch.setattr(motions, 'DURATION_S', 4.0)


@pytest.fixture
def motion(tmp_path):
    """A short motion of one joint, and its file."""
    parts = [move(0.0, LARGEST, 1.0), move(LARGEST, 0.0, 1.0), hold(0.2)]
    signal = sequence('there and back', parts)
    time = np.arange(0.0, signal.duration, 0.01)
    angle = np.stack([signal(time)[0], np.zeros_like(time)], axis=1)
    file = tmp_path / 'motion.csv'
    write_command_file(file, time, angle)
    return RigMotion('there and back', 'bend_x', '', CommandTable(JOINTS, time, angle)), file


def graph(rig=None, plant=None, folder=None):
    """All nodes in simulated time."""
    overrides = {}
    if plant is not None:
        save_plant(plant, folder / 'slave.yaml')
        overrides['motor_driver'] = {'plant_file': str(folder / 'slave.yaml')}
    return LiveGraph(
        None,
        private_domain(),
        lock_step=True,
        overrides=overrides,
        rate=TICK_RATE,
        rig=rig,
        nodes=(*NODES, RecorderNode),
    )


@pytest.fixture(scope='module')
def live():
    with graph() as live:
        yield live


def test_a_motion_is_played_in_a_session_of_its_own_and_leaves_everything_as_it_was(
    live, motion, tmp_path
):
    client, asked = live.client, []
    live.set('master', source='master')
    with pytest.raises(NotPlayedError):
        MotionPlayer(client, lambda words: False).play(*motion, tmp_path / 'unwanted')
    assert client.state == 'DISABLED'
    assert not (tmp_path / 'unwanted').exists()
    player = MotionPlayer(client, lambda words: asked.append(words) or True)
    player.play(*motion, tmp_path / 'bag')
    live.advance(1.0)
    assert client.state == 'DISABLED'
    assert not client.session
    assert read_parameter(client, 'compensator.mode').value == 'bouc_wen'
    assert read_parameter(client, 'master.source').value == 'master'
    assert abs(live.shafts[0]) < 0.05
    assert asked == ['Play this motion: There and back of bend_x, 2 s, at most 29 deg?']
    commands = open_bag(tmp_path / 'bag').joint_state(SLAVE_COMMAND).select(JOINTS)
    played = commands.require('position')
    assert played[:, 0].max() == pytest.approx(LARGEST, abs=0.01)
    assert np.abs(played[:, 1]).max() < 0.05


@pytest.mark.nightly
def test_a_motion_is_played_through_a_plant_that_is_in_force_only_meanwhile(tmp_path):
    motion, csv = held_out(PlantDescription(), shipped_rig()), tmp_path / 'held_out.csv'
    write_command_file(csv, motion.table.time, motion.table.angle)
    gaps = tuple(EffectSpec('gear_backlash', joint, {'gap_rad': 0.3}) for joint in JOINTS)
    true = PlantDescription(effects=gaps)
    off = {}
    with graph(plant=true, folder=tmp_path) as live:
        client = live.client
        client.wait_until(lambda: False, 1.0)
        for name, plant in (('described', PlantDescription()), ('true', true)):
            file = tmp_path / f'{name}.yaml'
            save_plant(plant, file)
            player = MotionPlayer(client, lambda words: True)
            player.play(motion, csv, tmp_path / name, file)
            off[name] = tracked(tmp_path / name, csv).rmse
            assert read_parameter(client, 'compensator.mode').value == 'bouc_wen'
            assert read_parameter(client, 'compensator.selected_by').value == 'class'
        (tmp_path / 'none.yaml').write_text('joints: {elbow: {}}')
        with pytest.raises(NotPlayedError, match='does not take the plant'):
            player.play(motion, csv, tmp_path / 'none', tmp_path / 'none.yaml')
        assert client.state != 'ENABLED'
    assert off['true'] < 0.7 * off['described']


def test_a_fault_is_told_with_its_cause_and_what_was_recorded_stays(motion, tmp_path):
    rig = shipped_rig()
    rig = dataclasses.replace(rig, tension=dataclasses.replace(rig.tension, ceiling=6.0))
    with graph(rig) as live:
        player = MotionPlayer(live.client, lambda words: True)
        with pytest.raises(RigStoppedError, match='tension'):
            player.play(*motion, tmp_path / 'bag')
        assert live.client.state == 'FAULT'
        with pytest.raises(RigStoppedError, match='FAULT'):
            player.play(*motion, tmp_path / 'another')
    assert open_bag(tmp_path / 'bag').joint_state(SLAVE_COMMAND).stamp_ns.size


def test_an_interruption_pauses_the_graph_and_what_a_person_has_paused_is_not_enabled_again(
    live, motion, tmp_path
):
    client, heard, given = live.client, [], []
    inner = client.serve

    def interrupted(seconds):
        heard.append(client.state)
        if heard.count('ENABLED') == 20:
            raise KeyboardInterrupt
        return inner(seconds)

    client.serve = interrupted
    with pytest.raises(KeyboardInterrupt):
        MotionPlayer(client, lambda words: True).play(*motion, tmp_path / 'interrupted')
    assert client.state == 'PAUSED'
    live.advance(0.5)
    assert read_parameter(client, 'master.source').value == 'master'
    assert open_bag(tmp_path / 'interrupted').joint_state(SLAVE_COMMAND).stamp_ns.size
    # It is continued from there.
    client.serve = inner
    MotionPlayer(client, lambda words: True).play(*motion, tmp_path / 'again')
    player = MotionPlayer(client, lambda words: given.append('go') or True, hold_to_play=True)

    def person(seconds):
        if given == ['go'] and not player.prepares:
            given.append('enable')
            client.order('enable')
        elif given == ['go', 'enable'] and client.state == 'ENABLED':
            given.append('pause')
            client.order('pause')
        return inner(seconds)

    client.serve = person
    with pytest.raises(NotPlayedError, match='PAUSED'):
        player.play(*motion, tmp_path / 'paused')
    client.serve = inner
    assert given == ['go', 'enable', 'pause']
    assert client.state == 'PAUSED'


def test_without_a_person_to_ask_it_does_not_begin(tmp_path, capsys):
    save_plant(PlantDescription(), tmp_path / 'plant.yaml')
    words = ['investigate', '--plant', str(tmp_path / 'plant.yaml'), '--out', str(tmp_path / 'out')]
    assert cli.main(words) == 2
    assert '--attended' in capsys.readouterr().err
    assert not (tmp_path / 'out').exists()


@pytest.mark.nightly
def test_a_rig_as_described_is_explained_by_one_motion(tmp_path, capfd, monkeypatch):
    monkeypatch.setitem(live_graph.RATE, True, TICK_RATE)
    plant, out = tmp_path / 'plant.yaml', tmp_path / 'out'
    save_plant(PlantDescription(), plant)
    words = ['investigate', '--plant', str(plant), '--simulate', str(plant), '--attended']
    assert cli.main([*words, '--out', str(out)]) == 0
    log = json.loads((out / 'log.json').read_text())
    assert log['stopped'] == 'one_class_left'
    (only,) = log['rounds']
    assert only['answer']['names'] == []
    assert only['answer']['improved'] <= only['answer']['described']
    assert (out / 'plant.yaml').exists()
    html = (out / 'index.html').read_text()
    assert 'Calibration of bend_x and bend_y' in html
    # The described plant is as good as the improved one.
    described, improved = (each['rmse_deg'] for each in log['tracking'])
    assert [each['by'] for each in log['tracking']] == ['described', 'improved']
    assert improved == pytest.approx(described, rel=0.3)
    assert f'off by {described:.2g} deg' in html
    # It is at its end, and says so.
    assert cli.main([*words, '--out', str(out)]) == 2
    assert 'at its end' in capfd.readouterr().err
