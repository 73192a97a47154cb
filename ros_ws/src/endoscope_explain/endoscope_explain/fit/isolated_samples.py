"""Wrong tracker samples that show only against a simulation: the joint moves around them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.fit.model import Fit
from endoscope_explain.observe.observation import Channel, JointObservation
from endoscope_explain.observe.predicted_signals import view
from endoscope_explain.observe.stamps_on_ticks import StampsOnTicks
from endoscope_explain.recording import Recording
from endoscope_explain.recording.signals import signal_name

Array = NDArray[np.float64]

SPIKE = 8.0
"""Height in noise units of a residual that stands alone."""
ALONE = 5.0
"""Factor by which it is above the usual residual nearby."""
NEARBY = 15
"""Samples whose median size is the usual one."""
AROUND = 7
"""Samples whose median is what the one in their middle should be."""
SAME_STAMP_S = 1e-6
"""Stamps that differ by less are the same one."""


def without_isolated(
    recording: Recording, observations: tuple[JointObservation, ...], fits: tuple[Fit, ...]
) -> tuple[JointObservation, ...]:
    """Leave out tracker samples that stick out of the residual, where some were wrong already.

    `recording`: as audited. Where the audit found no wrong sample, none is left out here: a spike
        may be physics.
    `fits`: of the nominal plant to each of them.
    Returns: the very same tuple where nothing was left out.
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


def with_isolated_marked(recording: Recording, plant: PlantDescription) -> Recording:
    """Mark tracker samples that stick out of what a plant predicts as wrong.

    `recording`: as audited. Where the audit found no wrong sample, none is marked here.
    `plant`: that explains the rig.
    """
    bending = recording.bending
    if bending.valid.all():
        return recording
    seen = view(recording, {'explained': plant})
    valid = bending.valid.copy()
    for j, joint in enumerate(recording.joints):
        signal = signal_name('bending', joint)
        if signal in seen.signals:
            shown = seen.signals[signal]
            wrong = shown.time[_sticks_out(shown.residual('explained'))]
            valid[np.searchsorted(bending.time, wrong - SAME_STAMP_S), j] = False
    return recording.with_series({'bending': replace(bending, valid=valid)})


def _sticks_out(residual: Array) -> NDArray[np.bool_]:
    # Mirrored at the ends: with the last sample repeated, a wrong one would be its own median.
    usual = median_filter(np.abs(residual), NEARBY, mode='mirror')
    # Up to three samples in a row stick out of the median; a step of the joint does not.
    height = residual - median_filter(residual, AROUND, mode='mirror')
    return np.asarray(np.abs(height) > np.maximum(SPIKE, ALONE * usual))


def _kept(channel: Channel, residual: Array) -> Channel:
    wrong = _sticks_out(residual)
    if not wrong.any():
        return channel
    keep = ~wrong
    # A tracker sample is one raw sample.
    return replace(
        channel,
        stamps=StampsOnTicks(
            channel.stamps.tick[keep],
            channel.stamps.share[keep],
            np.arange(int(keep.sum())),
            channel.stamps.count[keep],
        ),
        time=channel.time[keep],
        value=channel.value[keep],
        noise=channel.noise[keep],
    )
