"""What a recording of the same rig in health tells: its parameters, and what never fitted.

A difference between rig and plant that was already there is no news. Where both recordings have
the same commands it is known sample by sample and taken off; elsewhere its size is added to the
noise.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit.model import Fit
from endoscope_explain.observe.observation import Channel, JointObservation

Array = NDArray[np.float64]

SAME_COMMAND_RAD = 1e-6


def against_baseline(observation: JointObservation, healthy: Fit) -> JointObservation:
    """A joint's observation as seen against the same joint in health.

    `healthy`: of the baseline recording of the same joint.
    Returns: with readings or noise corrected by what the plant never explained.
    """
    before = healthy.model.observation
    repeated = _same_commands(observation, before)
    parts = dict(zip((c.signal for c in before.channels), before.slices(), strict=True))
    known = {c.signal: c for c in before.channels}
    channels = []
    for channel in observation.channels:
        if channel.signal not in known:
            channels.append(channel)
            continue
        residual = healthy.residuals[parts[channel.signal]]
        channels.append(_corrected(channel, known[channel.signal], residual, repeated))
    return replace(observation, channels=tuple(channels))


def _same_commands(one: JointObservation, other: JointObservation) -> bool:
    length = min(one.inputs.shape[1], other.inputs.shape[1])
    return bool(
        abs(one.inputs.shape[1] - other.inputs.shape[1]) <= 2
        and np.max(np.abs(one.inputs[0, :length, 0] - other.inputs[0, :length, 0]))
        < SAME_COMMAND_RAD
    )


def _corrected(channel: Channel, before: Channel, residual: Array, repeated: bool) -> Channel:
    size = float(np.mean(residual**2))
    same_stamps = len(channel.time) == len(before.time) and np.allclose(
        channel.time, before.time, atol=1e-4
    )
    if repeated and same_stamps and size > 1.1:
        # The residual is simulated minus measured.
        return replace(
            channel,
            value=channel.value + residual * before.noise,
            noise=np.hypot(channel.noise, before.noise),
        )
    return replace(channel, noise=channel.noise * np.sqrt(max(size, 1.0)))
