"""From a noisy handle to the tip, without any ROS: what is at rest stays at rest."""

import math

import numpy as np
import pytest

from endoscope_core.control import (
    ADAPTIVE_PHYSICAL,
    MODES,
    AdaptiveBacklashController,
    DesiredMotion,
    Feedforward,
    FeedforwardSettings,
    Handle,
    MotorLimits,
    PhysicalParameters,
    TrackerMeasurement,
)
from endoscope_core.control.limits import COUNT
from endoscope_core.identification.law_choice import CalibrationFindings, LawChoice
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.sensing import SensorModel
from endoscope_core.physics.simulator import PlantSimulator
from endoscope_core.rig import shipped_rig

TICK = 1e-3
LIMITS = MotorLimits.of(shipped_rig())
FEEDBACK = {'alone': None, 'adaptive': AdaptiveBacklashController}
# At the slowest rate what amplifies most, at night every mode alone; test_handle.py has the other
# rates.
CASES = [(mode, 'adaptive', 50) for mode in ('none', 'bouc_wen', 'physical')]
CASES += [(ADAPTIVE_PHYSICAL, 'alone', 50)]
CASES += [pytest.param(mode, 'alone', 1000, marks=pytest.mark.nightly) for mode in MODES]


def moved_to_and_rested_at(time):
    return 1.2 * min(1.0, max(0.0, time - 0.4))


def back_and_forth(time):
    """Triangle of 0.1 rad/s between -0.12 and 0.12 rad."""
    return 0.24 / math.pi * math.asin(math.sin(math.pi * 0.1 / 0.24 * max(0.0, time - 0.4)))


def handled(rate, angle_at, seconds, noise):
    """Positions and velocities (N, 2) that a handle of `rate` Hz asks for at 1 kHz."""
    hand, generator = Handle((-1.75, -1.75), (1.75, 1.75)), np.random.default_rng(rate)
    due, wanted = 0, []
    for tick in range(round(seconds / TICK)):
        now = tick * 1_000_000 + 1
        while due * 1e9 / rate <= now:
            angles = [
                angle_at(due / rate) + noise * COUNT * x for x in generator.integers(-1, 2, 2)
            ]
            hand.take(round(due * 1e9 / rate) + 1, angles, now)
            due += 1
        if tick == 200:
            hand.engage((0.0, 0.0))
        wanted.append(hand.follow(now) or ((0.0, 0.0), (0.0, 0.0)))
    return wanted


def tip_and_shafts(wanted, mode, feedback):
    """Tip angles (N, 2) and shaft commands (N, 2) of the nominal rig with a tracker of 40 Hz."""
    plant = PlantDescription()
    rig, sensors = PlantSimulator(plant, TICK), SensorModel(plant.sensors, 1)
    motion, feedforward = (DesiredMotion(2), Feedforward(2, FeedforwardSettings(LIMITS)))
    plants = tuple(map(PhysicalParameters, plant.joints.values()))
    by = 'plant' if 'physical' in mode else 'class'
    findings = CalibrationFindings(class_deg=70, plants=plants)
    feedforward.select(LawChoice(2).law(mode, by, findings))
    make = FEEDBACK[feedback]
    controller = make(2) if make else None
    if controller:
        controller.activate()
    tips, shafts = [], []
    for k, (position, velocity) in enumerate(wanted):
        angle, speed = motion.follow(position, velocity, TICK)
        sample, measurement = rig.sample, None
        if k % 25 == 0:
            measurement = TrackerMeasurement(k * TICK, sensors.bending(sample.bending))
            feedforward.measure(0.0, measurement.angle)
        drive = feedforward.step(angle, speed, TICK)
        if controller:
            drive = drive + controller.step(k * TICK, angle, speed, measurement)
        tips.append(sample.bending_true.copy())
        shafts.append(shipped_rig().joints.gear * drive)
        rig.advance(shafts[-1])
    return np.array(tips), np.array(shafts)


@pytest.mark.parametrize(('mode', 'feedback', 'rate'), CASES)
def test_noise_of_one_count_at_rest_does_not_move_the_tip(mode, feedback, rate):
    wanted = handled(rate, moved_to_and_rested_at, 3.0, noise=True)
    tips, shafts = tip_and_shafts(wanted, mode, feedback)
    assert np.min(tips[-1]) > 0.2
    at_rest = slice(2000, None)
    assert np.max(np.ptp(tips[at_rest], axis=0)) < 0.02
    assert np.max(np.ptp(shafts[at_rest], axis=0)) < 0.02


@pytest.mark.parametrize(
    ('mode', 'feedback', 'rate'),
    [
        ('bouc_wen', 'adaptive', 50),
        pytest.param('physical', 'alone', 250, marks=pytest.mark.nightly),
        pytest.param(ADAPTIVE_PHYSICAL, 'alone', 1000, marks=pytest.mark.nightly),
    ],
)
def test_a_slow_motion_is_followed_with_noise_about_as_well_as_without(mode, feedback, rate):
    errors = []
    for noise in (False, True):
        wanted = handled(rate, back_and_forth, 6.0, noise)
        tips, _ = tip_and_shafts(wanted, mode, feedback)
        asked = np.array([position for position, _ in wanted])
        errors.append(np.sqrt(np.mean((tips - asked)[1000:] ** 2)))
    assert errors[1] < errors[0] + 0.02
