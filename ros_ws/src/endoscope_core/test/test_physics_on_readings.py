"""What the effects of the sensors do to their readings, and that they leave the rig alone."""

import numpy as np
import pytest
from physics_rig import hand, run
from scipy.signal import lsim

from endoscope_core.physics import PlantDescription, PlantSimulator, simulate
from endoscope_core.physics.description import EffectSpec, JointParameters

TICK = 1e-3
TIME = TICK * np.arange(3000)
COMMAND = hand(3000, TICK)


@pytest.fixture(scope='module')
def nominal():
    return run(COMMAND)


def test_tracker_bias_and_drift_add_up(nominal):
    given = {'tracker_bias': {'bias_rad': 0.07}, 'tracker_drift': {'rate_rad_per_s': 0.01}}
    done = run(COMMAND, given)
    np.testing.assert_allclose(done.bending, nominal.joint + 0.07 + 0.01 * TIME, atol=1e-14)
    np.testing.assert_array_equal(done.joint, nominal.joint)


def test_metal_distorts_what_is_late(nominal):
    bend = {'linear': 0.1, 'quadratic': 0.2, 'cubic': -0.3, 'wave_rad': 0.05, 'wave_phase': 0.5}
    given = {'tracker_distortion': bend | {'wave_number': 6.0}, 'tracker_delay': {'delay_s': 0.03}}
    q = np.interp(TIME - 0.03, TIME, nominal.joint)
    wave = 0.05 * (np.sin(6.0 * q + 0.5) - np.sin(0.5))
    expected = q + 0.1 * q + 0.2 * q**2 - 0.3 * q**3 + wave
    np.testing.assert_allclose(run(COMMAND, given).bending, expected, atol=1e-12)


@pytest.mark.parametrize('wire', [0, 1])
def test_one_load_cell_reads_wrong(nominal, wire):
    own, neighbour = (nominal.a, nominal.b) if wire == 0 else (nominal.b, nominal.a)
    expected = {
        'load_cell_crosstalk': ({'share': 0.2}, own + 0.2 * neighbour),
        'load_cell_gain': ({'gain': 1.3}, 1.3 * own),
        'load_cell_bias': ({'bias_n': -0.4}, own - 0.4),
        'load_cell_drift': ({'rate_n_per_s': 0.1}, own + 0.1 * TIME),
        'load_cell_saturation': ({'limit_n': 6.0}, np.minimum(own, 6.0)),
    }
    assert own.max() > 6.5
    for effect_id, (values, reading) in expected.items():
        done = run(COMMAND, {effect_id: values | {'wire': float(wire)}})
        mine, others = (done.a, done.b) if wire == 0 else (done.b, done.a)
        np.testing.assert_allclose(mine, reading, atol=1e-12, err_msg=effect_id)
        np.testing.assert_array_equal(others, neighbour, err_msg=effect_id)


def test_both_cells_may_see_their_true_neighbour(nominal):
    done = run(COMMAND, {'load_cell_crosstalk': {'share': 0.25, 'wire': 2.0}})
    np.testing.assert_allclose(done.a, nominal.a + 0.25 * nominal.b, atol=1e-12)
    np.testing.assert_allclose(done.b, nominal.b + 0.25 * nominal.a, atol=1e-12)


def test_a_cell_clips_last(nominal):
    given = {'load_cell_gain': {'gain': 1.5}, 'load_cell_saturation': {'limit_n': 8.0}}
    np.testing.assert_allclose(run(COMMAND, given).a, np.minimum(1.5 * nominal.a, 8.0), atol=1e-12)


@pytest.mark.parametrize('ticks', [40, 12.5])
@pytest.mark.parametrize('effect_id', ['tracker_delay', 'load_cell_delay'])
def test_a_delay_is_of_its_time_and_of_its_sensor_alone(nominal, effect_id, ticks):
    late = run(COMMAND, {effect_id: {'delay_s': ticks * TICK}})
    now = np.arange(3000.0)
    for read in ('a', 'b', 'bending'):
        by = ticks if (read == 'bending') == (effect_id == 'tracker_delay') else 0.0
        expected = np.interp(now - by, now, getattr(nominal, read))
        np.testing.assert_allclose(getattr(late, read), expected, atol=1e-12)


def test_load_cell_lag_is_a_low_pass_of_first_order(nominal):
    lag = 0.05
    done = run(COMMAND, {'load_cell_lag': {'time_constant_s': lag}})
    for read, true in ((done.a, nominal.a), (done.b, nominal.b)):
        _, expected, _ = lsim(([1.0], [lag, 1.0]), true - true[0], TIME)
        np.testing.assert_allclose(read, true[0] + expected, atol=1e-9)
    np.testing.assert_array_equal(done.bending, nominal.bending)


def test_a_lag_goes_on_once_a_tick_however_often_its_cell_is_read():
    joint = {'bend_x': JointParameters()}
    spec = EffectSpec('load_cell_lag', 'bend_x', {'time_constant_s': 0.05})
    plant = PlantDescription(joint, effects=(spec,))
    stepped = PlantSimulator(plant)
    tensions = [stepped.advance([angle]).tension[0] for angle in COMMAND[:500]]
    whole = simulate(plant, COMMAND[:501, None])
    np.testing.assert_allclose(tensions, whole.tension[1:, 0], atol=1e-12)
