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
from endoscope_core.control.motor_limits import shipped_limits
from endoscope_core.metrics import tracking_rmse
from endoscope_core.physics import PlantDescription, PlantSimulator, SensorModel
from endoscope_core.signals import Signal

TICK = 1.0e-3


@dataclass(frozen=True)
class TrackingTrial:
    """What came of it, N ticks of 1 ms, J joints; angles in rad.

    Shapes: `time`, `desired` (N,).
    `bending` (N, J): true bending angle.
    `command` (N, J): joint-equivalent motor command.
    `tension` (N, J, 2): true tensions of the positive and the negative wire at the motor, N.
    `rmse`: of all joints in the signal's steady part.
    """

    time: NDArray[np.float64]
    desired: NDArray[np.float64]
    bending: NDArray[np.float64]
    command: NDArray[np.float64]
    tension: NDArray[np.float64]
    rmse: float

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
    """Drive every joint of a rig along a signal.

    `signal`: desired angle of every joint.
    `feedback`: whether the tracker's noisy readings are used: learnt from by the law in mode
        'adaptive_physical', otherwise by the controller.
    `seed`: of the tracker's noise.
    `controller`: what corrects from the tracker; the adaptive law of the second paper if not given.
    """
    rig, sensors = PlantSimulator(plant, TICK), SensorModel(plant.sensors, seed)
    joints = len(rig.joints)
    gear = shipped_limits().gear
    motion, feedforward = DesiredMotion(joints), Feedforward(joints)
    feedforward.select(law)
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
