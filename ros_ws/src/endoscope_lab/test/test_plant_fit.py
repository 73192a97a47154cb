from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.identification.plant_fit import FITTED, PlantFitError, fit_plant
from endoscope_core.physics import JointParameters, PlantDescription, SensorModel, simulate
from endoscope_core.physics.family import CENTRE, shipped_family
from endoscope_core.rig import load_rig
from endoscope_lab.dataset import random_instrument
from endoscope_lab.dataset.rig_variation import in_tube

TIME = np.arange(3500) * 1e-3
COMMAND = 0.5 * np.pi * np.sin(TIME)
GEAR = load_rig().joints.gear


def recorded(plant, seed):
    made = simulate(plant, np.repeat(GEAR * COMMAND[:, None], len(plant.joints), axis=1))
    wires = SensorModel(plant.sensors, seed).tension(made.tension.reshape(TIME.size, -1))
    return next(iter(plant.joints.values())), wires[:, :2], made.bending_true[:, 0]


def tip_missed(fit, bending):
    model = PlantDescription(joints={'bend_x': fit.parameters.joint})
    made = simulate(model, GEAR * COMMAND[:, None]).bending_true[:, 0]
    return np.sqrt(np.mean((made - bending) ** 2))


@pytest.mark.parametrize(
    ('seed', 'bend', 'unevenness'),
    [pytest.param(1, 0.5, 0.0, marks=pytest.mark.nightly), (2, 2.0, 0.3)],
)
def test_three_seconds_of_two_tensions_show_plant_and_tip(seed, bend, unevenness):
    plant = in_tube(random_instrument(np.random.default_rng(seed)), bend, unevenness)
    truth, tension, bending = recorded(plant, seed)
    fit = fit_plant(COMMAND, tension, gear=GEAR)
    assert fit.tension_rmse == pytest.approx(0.02, abs=0.004)
    assert fit.parameters.joint.capstan_exponent == pytest.approx(truth.capstan_exponent, rel=0.04)
    assert tip_missed(fit, bending) < np.deg2rad(1.0)
    again = fit_plant(COMMAND, tension, bending, gear=GEAR)
    assert again.bending_rmse < np.deg2rad(0.2)
    assert fit_plant(COMMAND, tension, gear=GEAR) == fit


@pytest.mark.parametrize('share', [0.5, pytest.param(1.6, marks=pytest.mark.nightly)])
def test_wires_that_have_crept_or_were_tightened_hide_nothing(share):
    plant = in_tube(random_instrument(np.random.default_rng(5)), 1.0, 0.1)
    name, joint = next(iter(plant.joints.items()))
    loose = replace(joint, pretension=share * joint.pretension)
    truth, tension, bending = recorded(replace(plant, joints={name: loose}), 5)
    fit = fit_plant(COMMAND, tension, gear=GEAR)
    assert fit.parameters.joint.pretension == pytest.approx(truth.pretension, rel=0.03)
    assert tip_missed(fit, bending) < np.deg2rad(1.0)


def test_another_gear_comes_from_another_pulley():
    plant = in_tube(random_instrument(np.random.default_rng(3)), 1.5, 0.1)
    name, joint = next(iter(plant.joints.items()))
    joint = replace(joint, pulley_radius=GEAR / 0.6 * joint.pulley_radius)
    plant = replace(plant, joints={name: joint})
    made = simulate(plant, 0.6 * COMMAND[:, None])
    wires = SensorModel(plant.sensors, 3).tension(made.tension.reshape(TIME.size, -1))
    right, wrong = (fit_plant(COMMAND, wires, gear=gear).parameters.joint for gear in (0.6, 0.5))
    assert right.pulley_radius == pytest.approx(joint.pulley_radius, rel=0.03)
    assert wrong.pulley_radius > 1.15 * joint.pulley_radius
    model = simulate(PlantDescription(joints={name: right}), 0.6 * COMMAND[:, None])
    missed = model.bending_true[:, 0] - made.bending_true[:, 0]
    assert np.sqrt(np.mean(missed**2)) < np.deg2rad(1.0)


def test_the_nominal_rig_is_known_though_no_tube_of_the_family_is_like_it():
    joint = replace(JointParameters(), capstan_exponent=1.2)
    truth, tension, bending = recorded(PlantDescription(joints={'bend_x': joint}), 3)
    fit = fit_plant(COMMAND, tension, gear=GEAR)
    assert fit.parameters.joint.capstan_exponent == pytest.approx(truth.capstan_exponent, rel=0.02)
    assert tip_missed(fit, bending) < np.deg2rad(1.0)


def test_parameters_stay_in_their_bounds_whatever_is_recorded():
    wild = np.random.default_rng(0).uniform(-50.0, 50.0, (TIME.size, 2))
    start = shipped_family().joint(CENTRE)
    found = fit_plant(COMMAND, wild, start=start, gear=GEAR).parameters.joint
    assert 0.02 <= found.capstan_exponent <= 4.51
    for name, spread in list(FITTED.items())[1:]:
        ratio = getattr(found, name) / getattr(start, name)
        assert abs(np.log(ratio)) <= 3.0 * spread + 1e-9, name


@pytest.mark.parametrize(
    ('command', 'tension', 'complaint'),
    [
        (COMMAND, np.zeros((10, 2)), r'must be \(N,\)'),
        (COMMAND[:500], np.zeros((500, 2)), 'too few'),
        (COMMAND, np.full((TIME.size, 2), np.nan), 'not finite'),
        (0.1 * COMMAND, np.zeros((TIME.size, 2)), 'less than 20 deg'),
    ],
)
def test_what_shows_nothing_is_refused(command, tension, complaint):
    with pytest.raises(PlantFitError, match=complaint):
        fit_plant(command, tension, gear=GEAR)
