import numpy as np
import pytest

from endoscope_core.dataset.rig_variation import in_tube, random_rig
from endoscope_core.identification.plant_fit import FITTED, PlantFitError, fit_plant
from endoscope_core.physics import SensorModel, simulate

TIME = np.arange(3500) * 1e-3
COMMAND = 0.5 * np.pi * np.sin(TIME)


def recorded(seed, exponent, evenness):
    plant = in_tube(random_rig(np.random.default_rng(seed)), exponent, evenness)
    gears = np.array([joint.gear for joint in plant.joints.values()])
    made = simulate(plant, COMMAND[:, None] * gears)
    wires = SensorModel(plant.sensors, seed).tension(made.tension.reshape(TIME.size, -1))
    return next(iter(plant.joints.values())), wires[:, :2], made.bending_true[:, 0]


@pytest.mark.parametrize(('seed', 'exponent', 'evenness'), [(1, 0.35, 0.0), (2, 1.0, 0.7)])
def test_three_seconds_of_two_tensions_show_plant_and_tip(seed, exponent, evenness):
    truth, tension, bending = recorded(seed, exponent, evenness)
    fit = fit_plant(COMMAND, tension)
    assert fit.tension_rmse == pytest.approx(0.02, abs=0.004)
    assert fit.parameters.joint.capstan_exponent == pytest.approx(truth.capstan_exponent, rel=0.04)
    again = fit_plant(COMMAND, tension, bending)
    assert again.bending_rmse < np.deg2rad(0.5)
    assert fit_plant(COMMAND, tension) == fit


def test_parameters_stay_in_their_bounds_whatever_is_recorded():
    wild = np.random.default_rng(0).uniform(-50.0, 50.0, (TIME.size, 2))
    found = fit_plant(COMMAND, wild).parameters.joint
    assert 0.02 <= found.capstan_exponent <= 4.51
    for name, spread in list(FITTED.items())[1:]:
        ratio = getattr(found, name) / getattr(type(found)(), name)
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
        fit_plant(command, tension)
