"""Motions of one joint, of which an experiment is chosen: each shows other physics."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.signals import Signal, hold, move, sequence
from endoscope_core.signals.motions import chirp, multisine, steps_with_holds, triangle

Array = NDArray[np.float64]

SAMPLE_S = 0.01


@dataclass(frozen=True)
class Waveform:
    """A motion of one joint; the others rest."""

    name: str
    joint: str
    time: Array  # (N,), s
    angle: Array  # (N,), desired bending angle in rad


def family(joint: str, others: tuple[str, ...], reach: float) -> list[Waveform]:
    """List the motions of a joint up to `reach` rad; the others are each moved alone, too."""
    a = reach
    signals = [
        ('steps with holds', steps_with_holds((0.5 * a, a, 0.2 * a, -a, -0.4 * a), 0.15, 2.0)),
        ('slow ramps', triangle(a, 0.25 * a)),
        ('chirp', chirp(0.7 * a, 14.0, 0.2, 5.0)),
        ('multisine', multisine(a, 14.0)),
        ('nested reversals', nested_reversals(a)),
        ('fast and slow', fast_and_slow(a)),
        ('rest on either side', rest_on_either_side(a)),
    ]
    found = [_sampled(name, joint, signal) for name, signal in signals]
    found += [_sampled(f'{other} alone', other, multisine(a, 14.0)) for other in others]
    return found


def nested_reversals(reach: float) -> Signal:
    """Turn back earlier and earlier: inner loops within outer ones (`reach` in rad)."""
    parts, here = [], 0.0
    for share in (1.0, -1.0, 0.8, -0.6, 0.6, -0.3, 0.4, 0.0, 0.2, 0.0):
        target = share * reach
        parts.append(move(here, target, 0.4 + 1.2 * abs(target - here) / max(reach, 1e-9)))
        here = target
    return sequence('nested reversals', parts)


def fast_and_slow(reach: float) -> Signal:
    """Make the same stroke at three speeds: what depends on speed shows against what does not."""
    parts: list[Signal] = []
    for duration in (3.0, 1.2, 0.5):
        parts += [
            move(0.0, reach, 0.5 * duration),
            move(reach, -reach, duration),
            move(-reach, 0.0, 0.5 * duration),
            hold(0.4),
        ]
    return sequence('fast and slow', parts)


def rest_on_either_side(reach: float) -> Signal:
    """Rest for long at rest, bent one way and bent the other: what changes by itself shows."""
    return sequence(
        'rest on either side',
        [
            hold(3.0),
            move(0.0, reach, 1.0),
            hold(5.0, reach),
            move(reach, -reach, 1.5),
            hold(5.0, -reach),
            move(-reach, 0.0, 1.0),
            hold(1.0),
        ],
    )


def _sampled(name: str, joint: str, signal: Signal) -> Waveform:
    time = np.arange(0.0, signal.duration + 0.5 * SAMPLE_S, SAMPLE_S)
    angle, _ = signal(time)
    return Waveform(name, joint, time, np.asarray(angle))
