"""The plant in a compensator's mind: turning points, going through them again, reach."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from play_loop import play

from endoscope_core.control import MotorLimits, bending_range
from endoscope_core.control.internal_model import InternalModel, TurningPoints
from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_core.physics.simulator import simulate
from endoscope_core.rig import shipped_rig

LIMITS = MotorLimits.of(shipped_rig())


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=40), st.floats(0.01, 0.9))
def test_turning_points_say_what_a_hysteresis_remembers(values, half_gap):
    turns = TurningPoints([0.0])
    for value in values:
        turns.follow(value)
    whole, remembered = play([0.0, *values], half_gap), play(turns.values, half_gap)
    assert len(turns.values) <= 13
    assert turns.values[-1] == values[-1]
    if len(turns.values) < 11:
        assert remembered[-1] == pytest.approx(whole[-1], abs=1e-12)


@pytest.mark.parametrize('exponent', [0.3, 0.9, 1.6])
def test_going_through_the_angles_again_brings_the_model_where_it_was(exponent):
    joint = JointParameters(capstan_exponent=exponent)
    was, turns = InternalModel(joint, LIMITS), TurningPoints([0.0])
    time = np.arange(0.0, 8.0, 1e-3)
    for angle in (0.4 * np.sin(time) * np.sin(1.7 * time)).tolist():
        was.seek(angle, 1e-3)
        turns.follow(was.angle)
    again = InternalModel(joint, LIMITS)
    again.go_through(turns.values[1:])
    assert again.angle == pytest.approx(was.angle, abs=1e-3)
    assert again.shaft == pytest.approx(was.shaft, abs=0.01)
    assert again.tensions == pytest.approx(was.tensions, abs=0.1)


@given(st.floats(0.02, 2.5), st.lists(st.floats(-0.6, 0.6), min_size=1, max_size=8))
def test_an_angle_that_can_be_reached_is_reached(exponent, angles):
    model = InternalModel(JointParameters(capstan_exponent=exponent), LIMITS)
    for angle in angles:
        for _ in range(400):
            there = model.seek(angle, 5e-3)
            if there:
                break
        bounded = (
            abs(model.shaft) > LIMITS.travel - 1e-6 or max(model.tensions) > LIMITS.tension - 1e-3
        )
        assert there or bounded


@pytest.mark.parametrize('exponent', [0.3, 0.9, 1.4, 1.8])
def test_the_reach_is_what_a_slow_swing_of_the_motor_reaches(exponent):
    joint = JointParameters(capstan_exponent=exponent, joint_rest_angle=0.1)
    time = np.arange(0.0, 90.0, 5e-3)
    swing = LIMITS.travel * np.sin(0.2 * time)
    run = simulate(PlantDescription(joints={'bend_x': joint}), swing[:, None], 5e-3)
    steady = run.bending_true[time > 40.0]
    found = bending_range(joint, LIMITS)
    assert found.low == pytest.approx(np.min(steady), abs=1e-3)
    assert found.high == pytest.approx(np.max(steady), abs=1e-3)
