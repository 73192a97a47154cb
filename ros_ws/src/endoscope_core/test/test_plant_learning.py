"""The plant learnt from the tracker while it is inverted."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from endoscope_core.control import (
    DesiredMotion,
    Feedforward,
    FeedforwardLaw,
    FeedforwardSettings,
    MotorLimits,
    PhysicalParameters,
    PlantLearning,
)
from endoscope_core.control.internal_model import InternalModel
from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_core.physics.sensing import SensorModel
from endoscope_core.physics.simulator import TICK, PlantSimulator
from endoscope_core.rig import shipped_rig

LIMITS = MotorLimits.of(shipped_rig())
JOINT = JointParameters()


@given(st.lists(st.floats(-30.0, 30.0), min_size=1, max_size=80))
@settings(max_examples=20)
def test_estimates_stay_in_their_bounds_whatever_the_tracker_says(readings):
    parameters = PhysicalParameters(JOINT)
    learning = PlantLearning(parameters, LIMITS.gear)
    for k, reading in enumerate(readings):
        learning.sent(np.sin(0.1 * k), 0.004)
        found = learning.measured(0.001, reading).joint
        assert 0.019 < found.capstan_exponent < 4.51
        assert 0.6 < found.wire_stiffness / JOINT.wire_stiffness < 1.65
    assert np.all(np.linalg.eigvalsh(learning.covariance) > 0.0)


def test_the_predictor_is_the_plant_behind_its_servo():
    plant = PlantDescription(joints={'bend_x': JOINT})
    rig, learning = PlantSimulator(plant), PlantLearning(PhysicalParameters(JOINT), LIMITS.gear)
    misses = []
    for k in range(6000):
        command = 1.5 * np.sin(k * TICK) * np.sin(2.3 * k * TICK)
        learning.sent(command, TICK)
        rig.advance([LIMITS.gear * command])
        misses.append(learning.tip - rig.sample.bending_true[0])
    assert np.max(np.abs(misses)) < 1e-6


def test_measurements_at_rest_and_the_first_after_a_silence_move_nothing():
    feedforward = Feedforward(1, FeedforwardSettings(LIMITS))
    loose = PhysicalParameters(replace(JOINT, capstan_exponent=0.5))
    feedforward.select(FeedforwardLaw('adaptive_physical', (loose,)))
    model = InternalModel(JOINT, LIMITS)
    before = 0.0
    for k in range(3000):
        time = k * TICK
        command = feedforward.step([np.sin(time)], [np.cos(time)], TICK)[0]
        if k == 2800:
            feedforward.measure(0.0, [model.angle])
            assert np.max(np.abs(feedforward.offset)) > 0.01
        if k > 2800:
            # What the inverse makes of the motion, and half of the motion; the offset is far more.
            assert abs(command - before) < 4.0 * TICK
        model.turn(LIMITS.gear * command, TICK)
        before = command
    assert feedforward.learnt[0] != loose
    rest = [np.sin(2.999)], [0.0], TICK
    given_out = []
    for _ in range(2000):
        given_out.append(feedforward.step(*rest)[0])
        feedforward.measure(0.0, [model.angle + 0.1])
    assert np.ptp(given_out[1000:]) < 1e-9


def test_a_reading_that_is_late_teaches_what_it_says_of_its_own_time():
    plant = PlantDescription(joints={'bend_x': JOINT})
    rig, sensors = PlantSimulator(plant), SensorModel(plant.sensors, 2)
    motion, feedforward = DesiredMotion(1), Feedforward(1, FeedforwardSettings(LIMITS))
    feedforward.select(FeedforwardLaw('adaptive_physical', (PhysicalParameters(JOINT),)))
    tips = []
    for k in range(9000):
        angle, velocity = motion.follow([0.7 * np.sin(k * TICK)], [0.7 * np.cos(k * TICK)], TICK)
        tips.append(rig.sample.bending_true)
        if k % 25 == 0 and k > 60:
            feedforward.measure(0.06, sensors.bending(tips[k - 60]))
        rig.advance(LIMITS.gear * feedforward.step(angle, velocity, TICK))
    error = np.array(tips)[:, 0] - 0.7 * np.sin(TICK * np.arange(9000))
    assert np.sqrt(np.mean(error[2000:] ** 2)) < np.deg2rad(1.0)
