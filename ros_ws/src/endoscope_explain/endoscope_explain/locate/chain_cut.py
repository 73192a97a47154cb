"""Cut the chain at the motor: drive what lies behind it with the measured shaft."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.layout import IN_MOTOR
from endoscope_explain.case import ChainCut
from endoscope_explain.fit.simulated_joint import simulate_joint
from endoscope_explain.observe.observation import TICK, JointObservation, observe
from endoscope_explain.observe.predicted_signals import packed_rig, reading_lead, simulate_rig
from endoscope_explain.recording import Recording

Array = NDArray[np.float64]

SMOOTHED_S = 0.021
"""Window over which the encoder's steps are smoothed: shorter than the servo's answer."""
BEHIND = ('tension', 'bending')


def cut_at_motor(recording: Recording, plant: PlantDescription) -> tuple[ChainCut, ...]:
    """Compare both ways to drive wires and joint by a plain plant; none without shaft reading."""
    shaft = recording.shaft_position
    if shaft is None:
        return ()
    observations = observe(recording, plant)
    whole = simulate_rig(observations, plant)
    lead = reading_lead(observations, whole)
    parameters, flags = packed_rig(observations, plant)
    cuts = []
    for j, observation in enumerate(observations):
        inputs = observation.inputs.copy()
        k = recording.joints.index(observation.joint)
        time = shaft.time - recording.command.time[0] + lead * TICK
        inputs[0, :, IN_MOTOR] = _at_ends_of_ticks(time, shaft.values[:, k], inputs.shape[1])
        out = simulate_joint(observation, parameters[j], flags[j], inputs)
        misfits = (_misfit(observation, each, lead) for each in (whole[j], out))
        cuts.append(ChainCut(observation.joint, *misfits))
    return tuple(cuts)


def _at_ends_of_ticks(time: Array, angle: Array, ticks: int) -> Array:
    """The angle that a motor shall have reached at the end of each tick, smoothed."""
    period = float(np.median(np.diff(time)))
    width = max(5, 2 * int(0.5 * SMOOTHED_S / period) + 1)
    return np.interp(TICK * np.arange(1, ticks + 1), time, savgol_filter(angle, width, 2))


def _misfit(observation: JointObservation, outputs: Array, lead: float) -> float:
    total, count = 0.0, 0
    for channel in observation.channels:
        if channel.quantity in BEHIND:
            wrong = (channel.predicted(outputs, lead) - channel.value) / channel.noise
            total += float(wrong @ wrong)
            count += len(wrong)
    return float(np.sqrt(total / max(count, 1)))
