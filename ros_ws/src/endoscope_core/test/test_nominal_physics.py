"""Pieces of the nominal plant that a description may lack, and that are effects then."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.errors import FileError
from endoscope_core.physics import EffectSpec, PlantDescription, simulate
from endoscope_core.physics.description import SLAVE
from endoscope_core.physics.effects import NOMINAL_PHYSICS
from endoscope_core.physics.packing import pack
from endoscope_core.physics.plant_file import load_plant, save_plant

TIME = 1e-3 * np.arange(3000)
COMMAND = np.stack([0.9 * np.sin(3.0 * TIME)], axis=1)


def lacking(name):
    first = NOMINAL_PHYSICS[name].parameters[0]
    return replace(SLAVE, **{first.name: first.off})


def readings(plant):
    done = simulate(plant, COMMAND)
    return np.hstack([done.shaft_position, done.tension[:, 0], done.bending])


@pytest.mark.parametrize('name', NOMINAL_PHYSICS)
def test_a_plant_without_a_piece_is_simulated_and_answers_otherwise(name):
    whole = readings(PlantDescription({'bend_x': SLAVE}))
    without = readings(PlantDescription({'bend_x': lacking(name)}))
    assert np.isfinite(without).all()
    assert np.abs(without - whole).max() > 1e-3


def test_a_rigid_wire_without_anything_else_turns_the_joint_as_its_radii_do():
    joint = SLAVE
    for name in NOMINAL_PHYSICS:
        first = NOMINAL_PHYSICS[name].parameters[0]
        joint = replace(joint, **{first.name: first.off})
    done = simulate(PlantDescription({'bend_x': joint}), COMMAND)
    gear = joint.pulley_radius / joint.joint_radius
    # A tick late: the servo takes one to be where it was sent.
    np.testing.assert_allclose(done.bending[1:], gear * COMMAND[:-1], atol=2e-3)


@pytest.mark.parametrize('name', NOMINAL_PHYSICS)
def test_added_as_an_effect_a_piece_is_the_number_that_it_has(name, tmp_path):
    values = {p.name: p.typical for p in NOMINAL_PHYSICS[name].parameters}
    added = PlantDescription(
        {'bend_x': lacking(name)}, effects=(EffectSpec(name, 'bend_x', values),)
    )
    own = PlantDescription({'bend_x': replace(SLAVE, **values)})
    np.testing.assert_array_equal(readings(added), readings(own))
    save_plant(added, tmp_path / 'plant.yaml')
    assert load_plant(tmp_path / 'plant.yaml') == own


def test_a_piece_that_is_there_cannot_be_added():
    spec = EffectSpec('sheath_friction', 'bend_x', {'capstan_exponent': 1.0})
    with pytest.raises(ValueError, match=r'has it already, its capstan_exponent is 0\.9'):
        pack(PlantDescription(effects=(spec,)))


def test_a_plant_file_may_have_a_rigid_wire_and_a_servo_without_lag(tmp_path):
    path = tmp_path / 'plant.yaml'
    path.write_text('joints: {bend_x: {wire_stiffness: .inf, motor_bandwidth: .inf}}')
    joint = load_plant(path).joints['bend_x']
    for name in ('wire_stretch', 'servo_lag'):
        first = NOMINAL_PHYSICS[name].parameters[0]
        assert getattr(joint, first.name) == first.off
    path.write_text('joints: {bend_x: {pretension: .inf}}')
    with pytest.raises(FileError, match='pretension is inf'):
        load_plant(path)
