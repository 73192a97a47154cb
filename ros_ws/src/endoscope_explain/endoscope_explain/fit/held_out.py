"""How well a fitted joint predicts blocks of samples that the fit has not seen."""

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.explanation import ChannelFit
from endoscope_explain.fit.evidence import weights
from endoscope_explain.fit.model import Fit, fit
from endoscope_explain.observe.observation import JointObservation

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCK_S = 2.0
EVERY = 4
GAP_S = 0.2
"""Left out on both sides of a held-out block, for the memory of wires and tracker."""
REFIT_STEPS = 2


def judged_at(time: Array) -> Mask:
    """Tell which samples (N,) are held out, by their time in s from the first command.

    All are where there is no whole held-out block.
    """
    inside = np.mod(time, BLOCK_S * EVERY) >= BLOCK_S * (EVERY - 1)
    return inside if inside.any() else np.ones_like(inside)


def fitted_at(time: Array) -> Mask:
    """Tell which samples (N,) may be fitted or trained on: those far from a held-out block."""
    phase = np.mod(time, BLOCK_S * EVERY)
    return np.asarray((phase >= GAP_S) & (phase < BLOCK_S * (EVERY - 1) - GAP_S))


def held_out_masks(observation: JointObservation) -> tuple[Mask, Mask]:
    """Samples to judge on and samples to fit on, over all channels in a row (size,) each."""
    time = np.concatenate([channel.time for channel in observation.channels])
    return judged_at(time), fitted_at(time)


def held_out_fit(final: Fit) -> dict[str, ChannelFit]:
    """Refit without the held-out blocks and return the fit of every signal on them."""
    judged, residuals = _held_out(final)
    return on_samples(final.model.observation, residuals, judged)


def held_out_misfit(final: Fit) -> float:
    """Sum over the signals of the logarithm of what a refit leaves on blocks it has not seen."""
    judged, residuals = _held_out(final)
    return sum(
        float(np.log(np.maximum(np.mean(residuals[part][judged[part]] ** 2), 1.0)))
        for part in final.model.observation.slices()
        if judged[part].any()
    )


def _held_out(final: Fit) -> tuple[Mask, Array]:
    """Held-out samples (size,), and the residuals (size,) of a fit that has not seen them."""
    judged, used = held_out_masks(final.model.observation)
    if judged.all():
        return judged, final.residuals
    again = fit(
        final.model,
        final.theta,
        weight=used * weights(final.model.observation, final.residuals),
        iterations=REFIT_STEPS,
        known_jacobian=final.jacobian,
    )
    return judged, again.residuals


def on_samples(
    observation: JointObservation, residuals: Array, judged: Mask
) -> dict[str, ChannelFit]:
    """Return rmse and noise of every signal on the judged samples (size,)."""
    result = {}
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        use = judged[part]
        use = use if use.any() else np.ones_like(use)
        error = residuals[part][use] * channel.noise[use]
        result[channel.signal] = ChannelFit(
            float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(channel.noise[use] ** 2)))
        )
    return result
