"""Strength of a law: by the change of the signals, and by its residual after a refit of the rig."""

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
"""Range of the share of the signal that a law moves, in the channel that shows it most."""
CLOSE = 0.05
"""Relative tolerance of that share."""
_TRIES, _LAWS = 40, 30
_STEP = 8.0
NUDGE = 0.1
"""Step of a finite difference, in spreads."""


class OutOfReachError(RuntimeError):
    """A law that cannot move the measured signals by the wanted share."""


def moved(bare: Readings, other: Readings) -> float:
    """Rms change by a law over the standard deviation of the signal, in the worst channel."""
    return max(
        float(np.sqrt(np.mean((b - a) ** 2)) / max(np.std(a), 1e-12))
        for a, b in zip(bare.channels(), other.channels(), strict=True)
    )


def scaled_to(
    aim: float, seen: Callable[[float], Readings], start: float = 1.0
) -> tuple[float, float]:
    """Strength at which a law moves the readings `seen` by a share `aim`, and the share reached."""
    # `seen` raises ValueError for a strength that the law cannot have.
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
    raise OutOfReachError(f'no strength moves a measured signal by {100.0 * aim:.0f} %')


def drawn_as_strong[L](
    generator: np.random.Generator,
    aims: tuple[float, float],
    draw: Callable[[], tuple[L, Callable[[float], Readings], float]],
) -> tuple[L, float, float]:
    """Draw a law, its strength and the share it moves, log-uniformly between two aims."""
    # `draw` returns a law, the readings by its strength, and a starting strength. A law that cannot
    # move the drawn share is drawn again.
    for _ in range(_LAWS):
        law, seen, begin = draw()
        aim = float(np.exp(generator.uniform(*np.log(aims))))
        try:
            return law, *scaled_to(aim, seen, begin)
        except OutOfReachError:
            continue
    raise RuntimeError(f'none of {_LAWS} laws moves {100.0 * aims[0]:.0f} % of a signal')


def left(bare: PlantDescription, true: PlantDescription, command: Array) -> float:
    """Residual of a law after a refit, over the noise (rms), in the signal that shows it most."""

    # The refit is linear, around the rig without the law, with the spreads of the rig's parameters
    # as prior. Commands (N, J) are shaft angles in rad, every ms.
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
