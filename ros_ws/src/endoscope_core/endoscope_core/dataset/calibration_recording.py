"""One calibration as the sensors record it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.dataset.rig_variation import calibration_command
from endoscope_core.physics import PlantDescription, SensorModel, simulate
from endoscope_core.signals import CALIBRATION_RATE, CalibrationMotion, calibration_motion


@dataclass(frozen=True)
class CalibrationRecording:
    """What equation 2 of the first paper collects, N samples at 1 kHz, J = 2 joints.

    N = 9000 for the first paper's sinusoid.

    Parameters
    ----------
    tension : ndarray, shape (N, 4)
        N, in the order x_pos, x_neg, y_pos, y_neg.
    desired_angle, desired_velocity : ndarray, shape (N,)
        rad and rad/s, the same for both joints.
    actual_angle : ndarray, shape (N, J)
        rad; the tracker's 40 readings a second, joined by straight lines.
    """

    tension: NDArray[np.float64]
    desired_angle: NDArray[np.float64]
    desired_velocity: NDArray[np.float64]
    actual_angle: NDArray[np.float64]


def record_calibration(
    plant: PlantDescription, seed: int, motion: CalibrationMotion | None = None
) -> CalibrationRecording:
    """Simulate the calibration of both joints and read it through noisy sensors.

    Both joints move at once: the four tensions of the tube then come within one 9 s recording, as
    the paper's 11 s for the whole calibration ask; one joint after the other would take 18 s or
    leave each less than a period. Nothing couples the joints, so that neither is disturbed.

    Parameters
    ----------
    plant : PlantDescription
        With two joints.
    seed : int
        Of the sensor noise.
    motion : CalibrationMotion, optional
        The first paper's sinusoid if not given.
    """
    motion = motion or calibration_motion()
    trajectory = simulate(plant, calibration_command(plant, motion))
    sensors = SensorModel(plant.sensors, seed)
    angle, velocity = motion.signal(trajectory.time)
    wires = trajectory.tension.reshape(len(trajectory.time), -1)
    every = round(CALIBRATION_RATE / plant.sensors.tracker_rate)
    readings = sensors.bending(trajectory.bending[::every])
    actual = [np.interp(trajectory.time, trajectory.time[::every], r) for r in readings.T]
    return CalibrationRecording(sensors.tension(wires), angle, velocity, np.stack(actual, axis=1))
