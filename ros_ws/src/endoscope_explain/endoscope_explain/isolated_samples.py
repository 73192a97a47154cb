"""Wrong tracker samples that show only against a simulation: the joint moves around them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from endoscope_explain.fit import Fit
from endoscope_explain.observation import Channel, JointObservation
from endoscope_explain.recording import Recording

SPIKE = 8.0
"""Height in noise units of a residual that stands alone."""
ALONE = 5.0
"""Factor by which it is above the usual residual nearby."""
NEARBY = 15
"""Samples whose median size is the usual one."""
AROUND = 7
"""Samples whose median is what the one in their middle should be."""


def without_isolated(
    recording: Recording, observations: tuple[JointObservation, ...], fits: tuple[Fit, ...]
) -> tuple[JointObservation, ...]:
    """Leave out tracker samples that stick out of the residual, where some were wrong already.

    Parameters
    ----------
    recording : Recording
        As audited. Where the audit found no wrong sample, none is left out here: a spike may be
        physics.
    observations : tuple of JointObservation
    fits : tuple of Fit
        Of the nominal plant to each of them.

    Returns
    -------
    tuple of JointObservation
        The very same tuple where nothing was left out.
    """
    if recording.bending.valid.all():
        return observations
    cleaned = tuple(
        _without_isolated(observation, fit)
        for observation, fit in zip(observations, fits, strict=True)
    )
    before, after = (sum(o.size for o in group) for group in (observations, cleaned))
    return cleaned if after < before else observations


def _without_isolated(observation: JointObservation, fit: Fit) -> JointObservation:
    channels = tuple(
        _kept(channel, fit.residuals[part]) if channel.quantity == 'bending' else channel
        for channel, part in zip(observation.channels, observation.slices(), strict=True)
    )
    return replace(observation, channels=channels)


def _kept(channel: Channel, residual: NDArray[np.float64]) -> Channel:
    usual = median_filter(np.abs(residual), NEARBY, mode='nearest')
    # Up to three samples in a row stick out of the median; a step of the joint does not.
    height = residual - median_filter(residual, AROUND, mode='nearest')
    wrong = np.abs(height) > np.maximum(SPIKE, ALONE * usual)
    if not wrong.any():
        return channel
    keep = ~wrong
    # A tracker sample is one raw sample.
    return replace(
        channel,
        tick=channel.tick[keep],
        share=channel.share[keep],
        first=np.arange(int(keep.sum())),
        count=channel.count[keep],
        time=channel.time[keep],
        value=channel.value[keep],
        noise=channel.noise[keep],
    )
