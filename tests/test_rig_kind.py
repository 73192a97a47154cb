"""No recording can be mistaken for one of a real rig: the graph says what it is, late or early."""

import json

import pytest
from simulated_graph import SimulatedGraph

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr import encode_string
from endoscope_bags.message_types import STRING
from endoscope_bags.recording import kind_of_bag, rig_of_bag
from endoscope_bringup.cli import main
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_core.physics.plant_file import plant_as_text
from endoscope_core.rig import Kind, RigKind, digest, rig_as_text
from endoscope_lab.faults.motor_rig import MotorRig
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.runtime.private_domain import private_domain

MS = 10**6


@pytest.fixture(scope='module')
def of_the_simulation(tmp_path_factory):
    """Two recordings of one graph, the second begun while it ran."""
    folder = tmp_path_factory.mktemp('simulation')
    save_plant(PlantDescription(), folder / 'tight.yaml')
    overrides = {
        'motor_driver': {'plant_file': str(folder / 'tight.yaml')},
        'recorder': {'bag': str(folder / 'first')},
    }
    with SimulatedGraph(extra=(RecorderNode,), overrides=overrides) as graph:
        graph.advance(0.5)
        recorder = graph.nodes['recorder']
        recorder.stop()
        graph.advance(0.5)
        graph.set('recorder', bag=str(folder / 'second'))
        recorder.start()
        graph.connect()
        graph.advance(0.5)
        recorder.stop()
    return folder


@pytest.mark.parametrize('name', ['first', 'second'])
def test_a_simulation_says_so_and_by_what(of_the_simulation, name):
    bag = open_bag(of_the_simulation / name)
    rig = kind_of_bag(bag)
    assert rig.kind is Kind.SIMULATED
    assert rig.program.startswith('endoscope ')
    assert rig.rig_sha256 == digest(rig_as_text(rig_of_bag(bag)))
    assert rig.plant == 'tight.yaml'
    assert rig.plant_sha256 == digest(plant_as_text(PlantDescription()))


def test_servos_that_are_emulated_say_so(tmp_path):
    with MotorRig(tmp_path, domain=private_domain()) as rig:
        assert rig.wait(lambda: bool(rig.shafts))
        recorder = rig.node('recorder')
        assert rig.wait(lambda: recorder.bags.session.report().counts['/endoscope/rig/kind'])
    emulated = kind_of_bag(open_bag(rig.bag))
    assert (emulated.kind, emulated.plant) == (Kind.EMULATED, '')


def bag_that_says(path, *texts):
    with BagWriter(path) as writer:
        writer.write_raw('/rig/other', STRING, encode_string('kind: real'), MS)
        for text in texts:
            writer.write_raw('/endoscope/rig/kind', STRING, encode_string(text), 2 * MS)
    return path


def test_info_shows_it_and_what_is_missing_or_malformed_is_unknown(tmp_path, capsys):
    bag = bag_that_says(tmp_path / 'stated', 'kind: real', 'kind: emulated\nprogram: endoscope 1')
    assert main(['bag', 'info', str(bag), '--json']) == 0
    assert json.loads(capsys.readouterr().out)['rig']['kind'] == 'emulated'
    assert main(['bag', 'info', str(bag)]) == 0
    assert 'rig: emulated (endoscope 1)\n' in capsys.readouterr().out
    spoilt = tmp_path / 'spoilt'
    with BagWriter(spoilt) as writer:
        writer.write_raw('/rig/kind', STRING, b'\0\1\0\0\xff\xff', MS)
    for bag in (bag_that_says(tmp_path / 'silent'), spoilt):
        assert kind_of_bag(open_bag(bag)) == RigKind()
        assert main(['bag', 'info', str(bag)]) == 0
        assert 'rig: unknown\n' in capsys.readouterr().out
