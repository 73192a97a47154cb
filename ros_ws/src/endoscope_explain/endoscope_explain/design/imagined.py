"""Recordings that were never made: what a plant would answer to a motion."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.simulator import simulate
from endoscope_core.rig import Rig
from endoscope_explain.design.waveforms import Waveform
from endoscope_explain.observe.observation import TICK
from endoscope_explain.recording import Recording, Series

Array = NDArray[np.float64]


def imagine(plant: PlantDescription, waveform: Waveform, rig: Rig) -> Recording:
    """A plant's noise-free answer to a motion: the tracker at its rate, all else every tick."""
    time = np.arange(0.0, waveform.time[-1], TICK)
    joints = plant.joint_names()
    desired = np.zeros((len(time), len(joints)))
    desired[:, joints.index(waveform.joint)] = np.interp(time, waveform.time, waveform.angle)
    shaft = rig.joints.gear * desired
    answer = simulate(plant, shaft)
    slow = slice(None, None, max(1, round(1.0 / (plant.sensors.tracker_rate * TICK))))
    return Recording(
        waveform.name,
        0.0,
        joints,
        Series.of('motor/servo_jp', time, shaft),
        Series.of('wires/measured_js', time, answer.tension),
        Series.of('slave/measured_js', time[slow], answer.bending[slow]),
        Series.of('motor/measured_js', time, answer.shaft_position),
        Series.of('motor/measured_js', time, answer.shaft_velocity),
        Series.of('motor/measured_js', time, answer.shaft_effort),
        rig=rig,
    )


def is_safe(recording: Recording, tension_limit: float, bending_limit: float) -> bool:
    """Tell whether an imagined motion stays within a tension in N and an angle in rad."""
    assert recording.tension is not None
    return bool(
        recording.tension.values.max() <= tension_limit
        and np.abs(recording.bending.values).max() <= bending_limit
    )
