"""The inverse of the plant, on the plant it inverts and in the chain."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from endoscope_core.control import (
    Feedforward,
    FeedforwardLaw,
    FeedforwardSettings,
    MotorLimits,
    PhysicalInverse,
    PhysicalParameters,
    bending_range,
)
from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_core.physics.simulator import TICK, simulate
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import non_periodic_signal, periodic_signal

LIMITS = MotorLimits.of(shipped_rig())
JOINT = JointParameters()
PARAMETERS = PhysicalParameters(JOINT)
PERIODIC, NON_PERIODIC = periodic_signal(3.2 * np.pi), non_periodic_signal(12.0)


def plant(joint):
    return PlantDescription(joints={'bend_x': joint})


def commands(inverse, angle, velocity):
    first = inverse.begin(0.0, angle[0], velocity[0])
    return np.array(
        [first, *(inverse.wanted(a, v, TICK) for a, v in zip(angle[1:], velocity[1:], strict=True))]
    )


def simulated(joint, command):
    run = simulate(plant(joint), LIMITS.gear * command[:, None])
    return run.bending_true[:, 0], run.tension


@pytest.mark.parametrize('signal', [PERIODIC, NON_PERIODIC], ids=lambda signal: signal.name)
@pytest.mark.parametrize('exponent', [0.5, 0.9, 1.4])
def test_a_plant_that_is_known_is_followed(exponent, signal):
    joint = replace(JOINT, capstan_exponent=exponent)
    reached = bending_range(joint, LIMITS)
    most = np.max(np.abs(signal(np.arange(0.0, signal.duration, 0.01))[0]))
    signal = signal.scaled(min(1.0, 0.8 * min(-reached.low, reached.high) / most))
    time = np.arange(0.0, signal.steady[1], TICK)
    angle, velocity = signal(time)
    steady = time >= signal.steady[0]
    error = (
        simulated(
            joint, commands(PhysicalInverse(PhysicalParameters(joint), LIMITS), angle, velocity)
        )[0]
        - angle
    )
    uncompensated = simulated(joint, angle)[0] - angle
    assert np.std(error[steady]) < 0.025 * np.std(uncompensated[steady])
    assert np.max(np.abs(error[steady])) < np.deg2rad(3.5)


def test_motion_that_slows_down_but_does_not_turn_crosses_nothing():
    time = np.arange(0.0, 2.9, TICK)
    speed = 0.35 + 0.3 * np.cos(2.0 * np.pi * time / 1.5)
    angle = np.cumsum(speed) * TICK - 0.5
    inverse = PhysicalInverse(PARAMETERS, LIMITS)
    inverse.begin(1.0, -0.5, speed[0])
    command = np.array([inverse.wanted(a, v, TICK) for a, v in zip(angle, speed, strict=True)])
    assert np.min(np.diff(command)) > -1e-6


def test_a_desired_angle_that_trembles_does_not_turn_the_motor():
    inverse = PhysicalInverse(PARAMETERS, LIMITS)
    inverse.begin(1.0, 0.3, 0.0)
    generator = np.random.default_rng(3)
    trembling = 0.3 + 0.5 * 0.003 * generator.uniform(-1.0, 1.0, 2000)
    wanted = [inverse.wanted(angle, 0.0, TICK) for angle in trembling]
    assert np.ptp(wanted[500:]) < 1e-3
    # What is more than noise is crossed for, as fast as the motor turns.
    turned = [inverse.wanted(0.29, 0.0, TICK) for _ in range(300)]
    assert np.ptp(turned) > 0.3
    assert inverse.model.angle == pytest.approx(0.29, abs=2e-4)


def test_a_tube_that_does_not_reach_so_far_is_pulled_no_further_than_allowed():
    joint = replace(JOINT, capstan_exponent=1.4)
    time = np.arange(0.0, 12.0, TICK)
    limits = MotorLimits(gear=0.5, travel=1.5, speed=4.8, tension=15.0)
    inverse = PhysicalInverse(PhysicalParameters(joint), limits)
    command = commands(inverse, 1.5 * np.sin(time), 1.5 * np.cos(time))
    tip, tension = simulated(joint, command)
    assert np.max(tension) < 15.05
    assert np.max(np.abs(np.diff(command))) < 4.8 / 0.5 * TICK + 1e-9
    bound = bending_range(joint, limits)
    after = time > 6.5
    assert np.max(tip[after]) == pytest.approx(bound.high, rel=0.02)
    assert np.min(tip[after]) == pytest.approx(bound.low, rel=0.02)


@given(st.lists(st.tuples(st.floats(-1.7, 1.7), st.floats(-20.0, 20.0)), min_size=1, max_size=60))
@settings(max_examples=30)
def test_whatever_is_desired_the_command_is_finite_and_its_speed_and_travel_are_bounded(desired):
    feedforward = Feedforward(1, FeedforwardSettings(LIMITS))
    feedforward.select(FeedforwardLaw('physical', (PARAMETERS,)))
    last = None
    for angle, velocity in desired:
        command = feedforward.step([angle], [velocity], TICK)[0]
        assert abs(command) <= LIMITS.travel / LIMITS.gear + 1e-9
        if last is not None:
            assert abs(command - last) <= LIMITS.speed / LIMITS.gear * TICK + 1e-9
        last = command


def test_limits_out_of_range_are_refused():
    with pytest.raises(ValueError, match='tension'):
        MotorLimits(gear=0.5, travel=1.5, speed=4.8, tension=0.0)
