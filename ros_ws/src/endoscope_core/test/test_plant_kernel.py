"""The nominal plant against a plain explicit integration, and tick by tick against all at once."""

from dataclasses import astuple, replace

import numpy as np
import pytest
from numba import njit

from endoscope_core.effects import CATALOGUE
from endoscope_core.effects.slots import NOMINAL_KEYS
from endoscope_core.plant import (
    EffectSpec,
    JointParameters,
    PlantDescription,
    PlantSimulator,
    simulate,
)
from endoscope_core.plant.simulator import SUBSTEPS

TIME = 1e-3 * np.arange(8000)
SMOOTH = np.column_stack(
    [
        np.deg2rad(90.0) * np.sin(TIME),
        np.deg2rad(40.0) * np.sin(0.5 * TIME**2) * np.cos(TIME),
    ]
)
EVERY_EFFECT = tuple(EffectSpec(effect_id, 'bend_x') for effect_id in CATALOGUE)


@njit
def explicit_euler(command, parameters, steps):
    """The nominal plant's equations as they are written, `steps` explicit steps a millisecond."""
    t0, k, r, _, phi, xs, stiffness, damping, friction, qs, bandwidth, ratio = parameters
    m = dm = q = za = zb = zj = 0.0
    dt = 1e-3 / steps
    out = np.empty((len(command), 5))
    for n in range(len(command)):
        for _ in range(steps + 1):
            ta = max(0.0, t0 + k * r * (m - q))
            tb = max(0.0, t0 - k * r * (m - q))
            if _ == 0:
                out[n] = m, dm, q, ta * np.exp(0.5 * phi * za), tb * np.exp(0.5 * phi * zb)
                continue
            pull = r * (ta * np.exp(-0.5 * phi * za) - tb * np.exp(-0.5 * phi * zb))
            dq = (pull - stiffness * q - friction * zj) / damping
            v = 0.5 * r * (dm + dq)
            dza = v / xs * (1.0 - za * np.sign(v))
            dzb = -v / xs * (1.0 + zb * np.sign(v))
            dzj = dq / qs * (1.0 - zj * np.sign(dq))
            ddm = bandwidth**2 * (command[n] - m) - 2.0 * ratio * bandwidth * dm
            m, dm, q = m + dt * dm, dm + dt * ddm, q + dt * dq
            za, zb, zj = za + dt * dza, zb + dt * dzb, zj + dt * dzj
    return out


def compared(joint, steps, substeps):
    """Largest and rms difference of (tension in N, angle in deg) from the explicit integration."""
    plant = PlantDescription(joints={'bend_x': joint, 'bend_y': joint})
    trajectory = simulate(plant, SMOOTH * joint.gear, substeps=substeps)
    tension, angle = [], []
    for j in range(2):
        reference = explicit_euler(SMOOTH[:, j], np.array(astuple(joint)), steps)
        tension.append(trajectory.tension[:, j] - reference[:, 3:])
        angle.append(np.rad2deg(trajectory.bending[:, j] - reference[:, 2]))
    return [(np.abs(d).max(), np.sqrt(np.mean(np.square(d)))) for d in (tension, angle)]


@pytest.mark.parametrize('substeps', [3, SUBSTEPS, 10])
@pytest.mark.parametrize(
    'changed',
    [
        {},
        {'capstan_exponent': 2.1},
        {'capstan_exponent': 0.3},
        {'wire_stiffness': 2500.0, 'joint_damping': 2e-4, 'motor_damping_ratio': 1.2},
    ],
)
def test_agrees_with_explicit_steps_of_10_us_to_a_tenth_of_the_sensors_noise(changed, substeps):
    tension, angle = compared(replace(JointParameters(), **changed), 100, substeps)
    assert tension[0] < 0.002
    assert angle[0] < 0.025


def test_agrees_with_explicit_steps_of_100_us():
    tension, angle = compared(JointParameters(), 10, SUBSTEPS)
    assert tension[1] < 0.002
    assert angle[0] < 0.025


def test_motor_follows_its_second_order_equation():
    reference = explicit_euler(SMOOTH[:, 0], np.array(astuple(JointParameters())), 200)
    trajectory = simulate(PlantDescription(), 0.5 * SMOOTH)
    np.testing.assert_allclose(trajectory.shaft_position[:, 0], 0.5 * reference[:, 0], atol=2e-5)
    np.testing.assert_allclose(trajectory.shaft_velocity[:, 0], 0.5 * reference[:, 1], atol=1e-3)


def test_effort_is_the_wires_torque_on_the_pulley():
    trajectory = simulate(PlantDescription(), 0.5 * SMOOTH[:2000])
    torque = 0.005 * (trajectory.tension[:, :, 0] - trajectory.tension[:, :, 1])
    np.testing.assert_allclose(trajectory.shaft_effort, torque, atol=1e-15)


@pytest.mark.parametrize('effects', [(), EVERY_EFFECT], ids=['nominal', 'every effect'])
def test_tick_by_tick_is_exactly_the_batch(effects):
    plant = PlantDescription(effects=effects)
    command = 0.5 * SMOOTH[:1200]
    batch = simulate(plant, command)
    simulator = PlantSimulator(plant)
    for n in range(len(command)):
        sample = simulator.sample
        assert sample.time == pytest.approx(batch.time[n])
        for name in (
            'shaft_position',
            'shaft_velocity',
            'shaft_effort',
            'tension',
            'bending',
            'bending_true',
        ):
            np.testing.assert_array_equal(getattr(sample, name), getattr(batch, name)[n])
        simulator.advance(command[n])


def test_several_ticks_at_once_are_the_same_ticks():
    command = np.array([0.2, -0.1])
    one, many = PlantSimulator(PlantDescription()), PlantSimulator(PlantDescription())
    for _ in range(20):
        one.advance(command)
    np.testing.assert_array_equal(many.advance(command, n_ticks=20).tension, one.sample.tension)


def test_starts_at_rest_where_it_is_told():
    start = np.array([0.2, -0.3])
    trajectory = simulate(PlantDescription(), np.tile(start, (300, 1)), start_shaft=start)
    np.testing.assert_allclose(trajectory.bending[0], 2.0 * start)
    np.testing.assert_allclose(trajectory.shaft_position, np.tile(start, (300, 1)), atol=1e-12)
    np.testing.assert_allclose(trajectory.tension[0], 5.0)


@pytest.mark.parametrize('bad', [np.nan, np.inf, 1e7])
def test_a_command_that_no_shaft_can_follow_is_refused_and_changes_nothing(bad):
    simulator = PlantSimulator(PlantDescription())
    before = simulator.advance([0.1, 0.1], n_ticks=5)
    with pytest.raises(ValueError, match='not finite'):
        simulator.advance([0.1, bad])
    np.testing.assert_array_equal(simulator.sample.tension, before.tension)
    with pytest.raises(ValueError, match='not finite'):
        simulate(PlantDescription(), [[0.0, bad]])


@pytest.mark.parametrize('shape', [(5,), (5, 3), (0, 2)])
def test_a_command_of_another_shape_is_refused(shape):
    with pytest.raises(ValueError, match='shape'):
        simulate(PlantDescription(), np.zeros(shape))
    with pytest.raises(ValueError, match='shape'):
        PlantSimulator(PlantDescription()).advance(np.zeros(shape))


def test_slots_are_the_joint_parameters_in_order():
    assert tuple(JointParameters.__dataclass_fields__) == NOMINAL_KEYS
