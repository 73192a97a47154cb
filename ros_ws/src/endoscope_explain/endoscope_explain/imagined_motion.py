"""What a plant would answer to a motion, and whether that is safe."""

import numpy as np

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.simulator import TICK, simulate
from endoscope_core.rig import Rig
from endoscope_explain.recording import Array, RigRecording, Series


def answer_to(
    plant: PlantDescription, name: str, time: Array, angle: Array, rig: Rig
) -> RigRecording:
    """A plant's noise-free answer to a motion (N, J) in rad at times (N,)."""
    # The tracker at its rate, all else every tick.
    ticks = np.arange(0.0, time[-1], TICK)
    desired = np.stack([np.interp(ticks, time, column) for column in angle.T], axis=1)
    shaft = rig.joints.gear * desired
    answer = simulate(plant, shaft)
    slow = slice(None, None, max(1, round(1.0 / (plant.sensors.tracker_rate * TICK))))
    return RigRecording(
        name,
        0.0,
        plant.joint_names(),
        Series.of('motor/servo_jp', ticks, shaft),
        Series.of('wires/measured_js', ticks, answer.tension),
        Series.of('slave/measured_js', ticks[slow], answer.bending[slow]),
        Series.of('motor/measured_js', ticks, answer.shaft_position),
        Series.of('motor/measured_js', ticks, answer.shaft_velocity),
        Series.of('motor/measured_js', ticks, answer.shaft_effort),
        rig=rig,
    )


def is_safe(
    recording: RigRecording,
    tension_limit: float | Array,
    bending_limit: float | Array,
    slack_limit: float | Array = 0.0,
) -> bool:
    """Whether an imagined motion stays within tensions in N and angles in rad.

    Limits are of all, or of each joint (J,) and its two wires (J, 2).
    """
    assert recording.tension is not None
    return bool(
        np.all(recording.tension.values <= tension_limit)
        and np.all(recording.tension.values >= slack_limit)
        and np.all(np.abs(recording.bending.values) <= bending_limit)
    )
