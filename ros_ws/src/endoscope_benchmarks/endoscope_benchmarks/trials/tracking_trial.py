"""One tracking experiment: a desired motion, compensated or not, on the simulated rig."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.control import (
    ADAPTIVE_PHYSICAL,
    AdaptiveBacklashController,
    DesiredMotion,
    Feedforward,
    FeedforwardLaw,
    RecursiveHysteresisController,
    TrackerMeasurement,
)
from endoscope_core.control.limits import shipped_limits
from endoscope_core.metrics import tracking_rmse
from endoscope_core.physics import PlantDescription, PlantSimulator, SensorModel
from endoscope_core.signals import Signal

TICK = 1.0e-3


@dataclass(frozen=True)
class TrackingTrial:
    """What came of it, N ticks of 1 ms, J joints; angles in rad."""

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
    controller: AdaptiveBacklashController | RecursiveHysteresisController | None = None,
) -> TrackingTrial:
    """Drive every joint of a rig along a signal; feedback is by the tracker's noisy readings."""
    rig, sensors = PlantSimulator(plant, TICK), SensorModel(plant.sensors, seed)
    joints = len(rig.joints)
    gear = shipped_limits().gear
    motion, feedforward = DesiredMotion(joints), Feedforward(joints)
    feedforward.select(law)
    # In mode 'adaptive_physical' the law learns from them, otherwise the controller, by default the
    # adaptive law of the second paper.
    learns = law.mode == ADAPTIVE_PHYSICAL
    if controller is None:
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
