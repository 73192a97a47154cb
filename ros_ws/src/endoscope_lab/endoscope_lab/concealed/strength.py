"""How strong a law is: by what it moves, and by what a refit of the rig leaves of it."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics import PlantDescription
from endoscope_lab.concealed.readings import Readings, in_noise, read, worst_rms
from endoscope_lab.concealed.rigs import spreads, with_number

Array = NDArray[np.float64]

AIM = (0.1, 0.6)
"""Share of the signal that a law moves of the channel that shows it most."""
CLOSE = 0.05
"""Relative error of the share that is reached."""
_TRIES, _LAWS = 40, 30
_STEP = 8.0
NUDGE = 0.1
"""Of a difference for a slope, in spreads."""


class OutOfReachError(RuntimeError):
    """A law that does not move what is measured as far as it should."""


def moved(bare: Readings, other: Readings) -> float:
    """Rms of what a law changes over that of the signal about its mean, in the worst channel."""
    return max(
        float(np.sqrt(np.mean((b - a) ** 2)) / max(np.std(a), 1e-12))
        for a, b in zip(bare.channels(), other.channels(), strict=True)
    )


def scaled_to(
    aim: float, seen: Callable[[float], Readings], start: float = 1.0
) -> tuple[float, float]:
    """The strength at which a law moves what is `seen` at it by `aim`, and the share reached."""
    # Where a law cannot be as strong, `seen` raises ValueError.
    bare = seen(0.0)
    strength, below, above = start, 0.0, math.inf
    for _ in range(_TRIES):
        try:
            share = moved(bare, seen(strength))
        except ValueError:
            share = math.inf
        else:
            if abs(share - aim) <= CLOSE * aim:
                return strength, share
        if share < aim:
            below = strength
        else:
            above = strength
        guess = strength * min(_STEP, max(1.0 / _STEP, aim / max(share, 1e-9)))
        if math.isfinite(above) and not below < guess < above:
            guess = math.sqrt(below * above) if below else above / _STEP
        elif guess <= below:
            guess = _STEP * below
        if math.isfinite(above) and above - below < 1e-6 * above:
            break
        strength = guess
    raise OutOfReachError(f'no strength moves what is measured by {100.0 * aim:.0f} %')


def drawn_as_strong[L](
    generator: np.random.Generator,
    aims: tuple[float, float],
    draw: Callable[[], tuple[L, Callable[[float], Readings], float]],
) -> tuple[L, float, float]:
    """Draw a law, its strength and the share it moves, between two aims by its logarithm."""
    # `draw` gives a law, what is read by its strength, and a strength to begin at. A law that
    # cannot move as much as drawn is drawn again.
    for _ in range(_LAWS):
        law, seen, begin = draw()
        aim = float(np.exp(generator.uniform(*np.log(aims))))
        try:
            return law, *scaled_to(aim, seen, begin)
        except OutOfReachError:
            continue
    raise RuntimeError(f'no law of {_LAWS} moves {100.0 * aims[0]:.0f} % of a signal')


def left(bare: PlantDescription, true: PlantDescription, command: Array) -> float:
    """What a refit leaves of a law, over the noise (rms), of the signal that shows it most."""

    # The refit is linear, around the rig without the law, and holds the rig's numbers to the
    # spreads from which they are drawn. Commands (N, J) are shaft angles in rad, every ms.
    def seen(plant: PlantDescription) -> list[Array]:
        return in_noise(read(plant, command).signals(), bare.sensors)

    without = seen(bare)
    sizes = np.cumsum([len(column) for column in without])[:-1]
    start = np.concatenate(without)
    law = np.concatenate(seen(true)) - start
    slopes = []
    for name, joint in bare.joints.items():
        for key, spread in spreads(joint).items():
            other = with_number(joint, key, NUDGE * spread)
            plant = replace(bare, joints={**bare.joints, name: other})
            slopes.append((np.concatenate(seen(plant)) - start) / NUDGE)
    jacobian = np.column_stack(slopes)
    held = jacobian.T @ jacobian + np.eye(len(slopes))
    return worst_rms(np.split(law - jacobian @ np.linalg.solve(held, jacobian.T @ law), sizes))
