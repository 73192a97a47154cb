"""Which plants the nodes of a simulated slave take."""

import pytest

from endoscope_core.physics import EffectSpec, JointParameters, PlantDescription, save_plant
from endoscope_nodes.parameters import ParameterError
from endoscope_nodes.plant_parameter import load_plant_parameter


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
        load_plant_parameter('load_cells', str(tmp_path / 'plant.yaml'))
    assert "load_cells: parameter 'plant_file'" in str(refusal.value)


def test_wrong_samples_of_the_tracker_are_taken(tmp_path):
    plant = PlantDescription(effects=(EffectSpec('tracker_outliers', 'bend_y', {'rate': 0.1}),))
    save_plant(plant, tmp_path / 'plant.yaml')
    assert load_plant_parameter('em_tracker', str(tmp_path / 'plant.yaml')).effects[0].id == (
        'tracker_outliers'
    )
