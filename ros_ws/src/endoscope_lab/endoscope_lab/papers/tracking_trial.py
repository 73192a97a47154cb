"""Rigs in tubes that no fit has used: calibrated, and moved along a signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.classifier.classification import Classifier, UnseenTensionError
from endoscope_core.control import (
    ADAPTIVE_PHYSICAL,
    AdaptiveBacklashController,
    DesiredMotion,
    Feedforward,
    FeedforwardLaw,
    FeedforwardSettings,
    MotorLimits,
    TrackerMeasurement,
    bending_range,
)
from endoscope_core.identification.law_choice import CalibrationFindings
from endoscope_core.identification.plant_fit import plants_of_calibration
from endoscope_core.metrics import tracking_rmse, width_at_mid_height
from endoscope_core.physics import PlantDescription, PlantSimulator, SensorModel
from endoscope_core.rig import shipped_rig
from endoscope_core.safety import BendingRange
from endoscope_core.signals import Signal
from endoscope_lab.dataset import (
    TubeConfiguration,
    configuration_of_size,
    random_instrument,
    record_calibration,
)
from endoscope_lab.dataset.rig_variation import GREATEST_UNEVENNESS

TICK = 1.0e-3
LIMITS = MotorLimits.of(shipped_rig())


@dataclass(frozen=True)
class TrackingTrial:
    """Result of a trial, N ticks of 1 ms, J joints; angles in rad."""

    time: NDArray[np.float64]  # (N,)
    desired: NDArray[np.float64]  # (N,)
    bending: NDArray[np.float64]  # (N, J), true angle
    command: NDArray[np.float64]  # (N, J), joint-equivalent, of the motor
    # (N, J, 2), true, of the positive and the negative wire at the motor, N
    tension: NDArray[np.float64]
    rmse: float  # of all joints in the signal's steady part

    def peak(self, begin: float, end: float) -> float:
        """Largest error in rad of any joint from `begin` to `end` in s."""
        inside = (self.time >= begin) & (self.time <= end)
        return float(np.max(np.abs(self.bending[inside] - self.desired[inside, None])))


def run_tracking_trial(
    plant: PlantDescription,
    signal: Signal,
    law: FeedforwardLaw,
    feedback: bool,
    seed: int,
) -> TrackingTrial:
    """Drive every joint of a rig along a signal; feedback is from the tracker's noisy readings."""
    rig, sensors = PlantSimulator(plant, TICK), SensorModel(plant.sensors, seed)
    joints = len(rig.joints)
    gear = shipped_rig().joints.gear
    motion, feedforward = (
        DesiredMotion(joints),
        Feedforward(joints, FeedforwardSettings(LIMITS)),
    )
    feedforward.select(law)
    # In mode 'adaptive_physical' the law learns from the readings, otherwise the controller.
    learns = law.mode == ADAPTIVE_PHYSICAL
    controller = AdaptiveBacklashController(joints)
    if feedback and not learns:
        controller.activate()
    tracked_every = round(1.0 / (plant.sensors.tracker_rate * TICK))
    time = np.arange(0.0, signal.steady[1], TICK)
    angles, velocities = signal(time)
    bending = np.empty((time.size, joints))
    command = np.empty((time.size, joints))
    tension = np.empty((time.size, joints, 2))
    for k, now in enumerate(time.tolist()):
        sample = rig.sample
        bending[k], tension[k] = sample.bending_true, sample.tension
        desired, velocity = motion.follow([angles[k]] * joints, [velocities[k]] * joints, TICK)
        measured = None
        if k % tracked_every == 0:
            measured = TrackerMeasurement(now, sensors.bending(sample.bending))
            if feedback and learns:
                feedforward.measure(0.0, measured.angle)
        correction = controller.step(now, desired, velocity, measured)
        command[k] = feedforward.step(desired, velocity, TICK) + correction
        rig.advance(gear * command[k])
    steady = time >= signal.steady[0]
    wanted = np.repeat(angles[steady, None], joints, axis=1)
    rmse = tracking_rmse(wanted, bending[steady])
    return TrackingTrial(time, angles, bending, command, tension, rmse)


SHARE_OF_REACH = 0.8
SMALLEST_SIZE_DEG, GREATEST_SIZE_DEG = 42.0, 98.0
# Data sets draw from the seed alone; this separates test tubes from training tubes.
_UNSEEN = 424_243
_MOST_RIGS = 1000


@dataclass(frozen=True)
class NeverSeenTube:
    """One random rig in one random tube."""

    plant: PlantDescription
    size: float  # true backlash size in rad, mean of the joints
    noise: int  # seed of the sensors


def configuration_of(generator: np.random.Generator, size: float) -> TubeConfiguration:
    """The first random instrument that has a backlash size in rad, and the tube that gives it."""
    for _ in range(_MOST_RIGS):
        unevenness = generator.uniform(-GREATEST_UNEVENNESS, GREATEST_UNEVENNESS)
        found = configuration_of_size(random_instrument(generator), size, unevenness)
        if found is not None:
            return found
    raise RuntimeError(f'no rig of {_MOST_RIGS} reaches {np.rad2deg(size):.0f} deg')


def never_seen_tube(seed: int, number: int, size_deg: float | None = None) -> NeverSeenTube:
    """Draw a rig and the unevenness of its tube, for a backlash of 42 to 98 deg."""
    generator = np.random.default_rng([_UNSEEN, seed, number])
    drawn = float(generator.uniform(SMALLEST_SIZE_DEG, GREATEST_SIZE_DEG))
    size = np.deg2rad(drawn if size_deg is None else size_deg)
    found = configuration_of(generator, float(size))
    return NeverSeenTube(found.plant, found.backlash_size, int(generator.integers(2**31)))


def calibrate(tube: NeverSeenTube, classifier: Classifier) -> CalibrationFindings:
    """The 9 s calibration, read through noisy sensors: class, size, and plant of both joints."""
    # Without class and size where the classifier refuses the tensions as unseen.
    recording = record_calibration(tube.plant, tube.noise)
    gear = shipped_rig().joints.gear
    plants = plants_of_calibration(recording.desired_angle, recording.tension, gear)
    try:
        verdict = classifier.classify(recording.tension)
    except UnseenTensionError:
        return CalibrationFindings(plants=plants)
    return CalibrationFindings(verdict.class_deg, verdict.expected_size, plants)


def within_reach(signal: Signal, plant: PlantDescription) -> Signal:
    """A signal, scaled to 80 % of the reach of every joint of a plant if that is less."""
    return within_ranges(signal, [bending_range(joint, LIMITS) for joint in plant.joints.values()])


def within_ranges(signal: Signal, ranges: Sequence[BendingRange]) -> Signal:
    """A signal, scaled to 80 % of the nearest end of any range if that is less."""
    angle, _ = signal(np.arange(0.0, signal.duration, 0.01))
    end = min(min(-float(reached.low), float(reached.high)) for reached in ranges)
    return signal.scaled(min(1.0, SHARE_OF_REACH * end / float(np.max(np.abs(angle)))))


def backlash_left(trial: TrackingTrial, signal: Signal) -> float:
    """Width in rad of the loop of actual over desired angle in the steady part, mean of joints."""
    inside = (trial.time >= signal.steady[0]) & (trial.time <= signal.steady[1])
    widths = [
        width_at_mid_height(trial.desired[inside], bending)
        for bending in np.asarray(trial.bending[inside]).T
    ]
    return float(np.mean(np.abs(widths)))


def rmse_within(trial: TrackingTrial, begin: float, end: float) -> float:
    """RMSE in rad of all joints between two times in s."""
    inside: NDArray[np.bool_] = (trial.time >= begin) & (trial.time < end)
    error = trial.bending[inside] - trial.desired[inside, None]
    return float(np.sqrt(np.mean(error**2)))
