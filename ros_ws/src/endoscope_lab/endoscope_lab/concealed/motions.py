"""Motions of the recordings: for identification, for validation, and of a surgeon's hand."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.rig import shipped_rig
from endoscope_core.signals import Signal, calibration_sinusoid, hold, sequence
from endoscope_core.signals.motions import (
    chirp,
    multisine,
    steps_with_holds,
    teleoperation_like,
    triangle,
)

Array = NDArray[np.float64]

RATE = 1000.0
"""Rate of commands in 1/s, as the graph records them."""
REACH = (0.8, 1.25)
"""Range in rad of the largest desired angle."""
HAND_S = 30.0


def commissioning(generator: np.random.Generator, joints: int) -> Array:
    """Sinusoid, triangle, steps with holds, chirp and free moves: about 30 s (N, joints) in rad."""
    signals = []
    for k in range(joints):
        a = generator.uniform(*REACH)
        levels = a * generator.uniform(0.3, 1.0, 5) * generator.permutation([1, -1, 1, -1, -1])
        parts = [
            _sinusoid(a, generator.uniform(0.15, 0.3), 7.0),
            triangle(a, a * generator.uniform(0.6, 1.0)),
            steps_with_holds(tuple(levels), generator.uniform(0.1, 0.3)),
            chirp(generator.uniform(0.6, 0.9) * a, 6.0, 0.3, generator.uniform(3.0, 5.0)),
            _hand(generator, 6.0, a),
        ]
        # Each joint has its own order; joints after the first start later, so that what they show
        # before is coupling.
        order = [parts[i] for i in generator.permutation(len(parts))]
        if k:
            order[0] = hold(order[0].duration)
        signals.append(sequence('commissioning', order))
    return _shaft(signals)


def another(generator: np.random.Generator, joints: int) -> Array:
    """Multisine, free moves and a faster triangle, to judge on: about 18 s, as `commissioning`."""
    signals = []
    for _ in range(joints):
        a = 0.9 * generator.uniform(*REACH)
        parts = [
            multisine(a, 6.0, generator.uniform(0.15, 0.3)),
            _hand(generator, 8.0, a),
            triangle(a, 1.5 * a),
        ]
        order = generator.permutation(len(parts))
        signals.append(sequence('another', [parts[i] for i in order]))
    return _shaft(signals)


def sinusoid(generator: np.random.Generator, joints: int) -> Array:
    """The calibration motion of 9 s, as `commissioning`."""
    del generator
    return _shaft([calibration_sinusoid()] * joints)


def teleoperation(generator: np.random.Generator, joints: int) -> Array:
    """Minimum-jerk reaches with pauses, like a surgeon's, as `commissioning`."""
    return _shaft([_hand(generator, HAND_S, generator.uniform(*REACH)) for _ in range(joints)])


def _hand(generator: np.random.Generator, duration: float, reach: float) -> Signal:
    # A reach and its pause take a second on average.
    return teleoperation_like(int(generator.integers(2**31)), round(duration), reach)


def _sinusoid(amplitude: float, frequency: float, duration: float) -> Signal:
    """A multisine with one spectral line."""
    return multisine(amplitude, duration, frequency, 1)


def _shaft(signals: list[Signal]) -> Array:
    time = np.arange(0.0, max(signal.duration for signal in signals), 1.0 / RATE)
    return shipped_rig().joints.gear * np.column_stack([signal(time)[0] for signal in signals])
