"""Noise as it shows while a joint is held still, against what the sensor's description says."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.observe.observation import TICK, Channel, JointObservation

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SETTLED_S = 0.4
"""Time after the command's last change from which on a joint is at rest."""
LEAST_SAMPLES = 100
LARGEST_FACTOR = 4.0
WITH_NOISE = frozenset({'tension', 'bending', 'shaft_effort'})


def with_held_noise(observations: tuple[JointObservation, ...]) -> tuple[JointObservation, ...]:
    """Scale the known noise of each kind of sensor by what is seen in holds."""
    # Coloured noise averages out less than white noise does, and a sensor may be worse than its
    # description. Third differences of the readings in holds tell, without any model of the plant.
    # Sensors of one kind are taken together; where there is no hold, the description stands.
    squares: dict[str, list[Array]] = {}
    for observation in observations:
        still = held(observation)
        for channel in observation.channels:
            if channel.quantity in WITH_NOISE:
                squares.setdefault(channel.quantity, []).append(_squares(channel, still))
    factors = {}
    for quantity, found in squares.items():
        pooled = np.concatenate(found)
        if len(pooled) >= LEAST_SAMPLES:
            factors[quantity] = float(np.clip(np.sqrt(np.mean(pooled)), 1.0, LARGEST_FACTOR))
    return tuple(
        replace(
            observation,
            channels=tuple(
                replace(c, noise=c.noise * factors.get(c.quantity, 1.0))
                for c in observation.channels
            ),
        )
        for observation in observations
    )


def held(observation: JointObservation) -> Mask:
    """Ticks (N,) at which the command has been constant for `SETTLED_S`."""
    command = observation.inputs[0, :, 0]
    changes = np.flatnonzero(np.diff(command) != 0.0) + 1
    ticks = np.arange(len(command))
    if not len(changes):
        return np.ones(len(command), dtype=bool)
    last = np.searchsorted(changes, ticks, side='right') - 1
    since = ticks - np.where(last >= 0, changes[np.maximum(last, 0)], -len(command))
    return np.asarray(since * TICK > SETTLED_S)


def _squares(channel: Channel, still: Mask) -> Array:
    at_rest = still[channel.stamps.tick[channel.stamps.first]]
    whole = at_rest[:-3] & at_rest[3:]
    regular = np.diff(channel.time)
    even = np.ptp(np.stack([regular[:-2], regular[1:-1], regular[2:]]), axis=0) < 0.5 * np.median(
        regular
    )
    scaled = channel.value / channel.noise
    use = whole & even
    # The mean of the largest squares would be of slips and outliers, not of noise.
    squares = (np.diff(scaled, 3) ** 2 / 20.0)[use]
    return squares[squares < 25.0]
