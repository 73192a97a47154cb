"""Which plants the nodes of a simulated slave take."""

import pytest
from rclpy.context import Context

from endoscope_core.physics import EffectSpec, JointParameters, PlantDescription, save_plant
from endoscope_nodes.nodes.motor_driver import MotorDriverNode
from endoscope_nodes.runtime.node_context import load_slave
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.runtime import Runtime


@pytest.mark.parametrize(
    ('plant', 'said'),
    [
        (
            PlantDescription(effects=(EffectSpec('clock_skew', 'bend_x'),)),
            'effect clock_skew, which acts on recordings: leave it out',
        ),
        (
            PlantDescription(effects=(EffectSpec('recording_gap', 'bend_y'),)),
            'effect recording_gap, which acts on recordings: leave it out',
        ),
        (PlantDescription({'bend_x': JointParameters()}), 'describes bend_x; the nodes need'),
    ],
)
def test_what_no_slave_in_motion_can_be_is_refused(tmp_path, plant, said):
    save_plant(plant, tmp_path / 'plant.yaml')
    with pytest.raises(ParameterError, match=said) as refusal:
        load_slave('a rig', str(tmp_path / 'plant.yaml'))
    assert str(refusal.value).startswith('a rig: ')


def test_wrong_samples_of_the_tracker_are_taken(tmp_path):
    plant = PlantDescription(effects=(EffectSpec('tracker_outliers', 'bend_y', {'rate': 0.1}),))
    save_plant(plant, tmp_path / 'plant.yaml')
    assert load_slave('a rig', str(tmp_path / 'plant.yaml')).effects[0].id == ('tracker_outliers')


def saved(folder, name, exponent):
    joint = JointParameters(capstan_exponent=exponent)
    save_plant(PlantDescription({'bend_x': joint, 'bend_y': joint}), folder / name)
    return folder / name


def test_a_process_has_the_plant_and_seed_of_its_rig_file_unless_told_otherwise(tmp_path):
    saved(tmp_path, 'own.yaml', 0.3)
    rig = tmp_path / 'rig.yaml'
    rig.write_text('simulation: {plant: own.yaml, seed: 7}')
    other = saved(tmp_path, 'other.yaml', 0.6)
    for more, exponent, seed in (({}, 0.3, 8), ({'plant_file': str(other), 'seed': 0}, 0.6, 1)):
        overrides = {'motor_driver': {'rig_file': str(rig), **more}}
        args = ['--ros-args', '-p', 'use_sim_time:=true', '--log-level', 'fatal']
        with Runtime(args, Context(), 77, overrides) as runtime:
            runtime.add(MotorDriverNode)
            assert runtime.plant.joints['bend_x'].capstan_exponent == exponent
            assert runtime.seed_of(1) == seed


def test_a_file_is_named_by_its_whole_path_for_programs_in_other_folders(tmp_path, monkeypatch):
    plant = saved(tmp_path, 'hidden.yaml', 0.6)
    (tmp_path / 'rig.yaml').write_text('simulation: {seed: 7}')
    monkeypatch.chdir(tmp_path)
    words = ['-p', 'plant_file:=hidden.yaml', '-p', 'rig_file:=rig.yaml']
    args = ['--ros-args', '-p', 'use_sim_time:=true', '--log-level', 'fatal', *words]
    with Runtime(args, Context(), 77) as runtime:
        node = runtime.add(MotorDriverNode)
        assert node.get_parameter('plant_file').value == str(plant)
        assert node.get_parameter('rig_file').value == str(tmp_path / 'rig.yaml')
