"""How well a reversal can be crossed at all, if nothing is done long before it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.control import PhysicalInverse, PhysicalInverseSettings, PhysicalParameters
from endoscope_core.control.physical_inverse import MODEL_SUBSTEPS, InternalModel
from endoscope_core.effects.slots import JOINT
from endoscope_core.plant.inputs import IN_MOTOR, INPUTS
from endoscope_core.plant.kernel import advance_tick
from endoscope_core.signals import periodic_signal

TICK = 1.0e-3
COMMAND_RATE = 80.0
COMMAND_LIMIT = 3.0
_BEFORE, _AFTER = 300, 300
_SPACING = 8
_REVERSAL = 1.5 * np.pi


@dataclass(frozen=True)
class CrossingBound:
    """Errors around one reversal of ``60 sin t`` as shares of the uncompensated RMSE.

    Parameters
    ----------
    crossing : float
        Left where the dead zone is crossed at the turning point.
    best : float
        Left by the best command that the search found for the 0.3 s on either side.
    releasing : float
        Left by the law that begins earlier.
    """

    crossing: float
    best: float
    releasing: float


@compiled
def squared_error(
    start: Array,
    state: Array,
    history: Array,
    p: Array,
    on: Flags,
    x: Array,
    base: Array,
    bumps: Array,
    desired: Array,
    before: float,
) -> float:
    """Sum of squares in rad^2 over N ticks of the base command (N,) with bumps (K,) added to it.

    The bumps are joined by straight lines; the command keeps to `COMMAND_RATE` and `COMMAND_LIMIT`,
    the greatest that the motor driver obeys, from `before` on.
    """
    for i in range(start.size):
        state[i] = start[i]
    total = 0.0
    for k in range(base.size):
        j = k // _SPACING
        part = (k - j * _SPACING) / _SPACING
        first = bumps[j] if j < bumps.size else 0.0
        second = bumps[j + 1] if j + 1 < bumps.size else 0.0
        wanted = min(COMMAND_LIMIT, max(-COMMAND_LIMIT, base[k] + first + part * (second - first)))
        step = COMMAND_RATE * TICK
        before += min(step, max(-step, wanted - before))
        error = state[JOINT] - desired[k]
        total += error * error
        advance_tick(state, history, p, on, before, x, TICK, MODEL_SUBSTEPS)
    return total


def crossing_bound(parameters: PhysicalParameters, seed: int, tries: int = 15_000) -> CrossingBound:
    """Search the best command for a reversal on the exact plant, by an evolution strategy.

    A (1+1) strategy that moves one to four neighbouring bumps at a time; what it finds is what is
    possible at least, not a proof that no more is.

    Parameters
    ----------
    parameters : PhysicalParameters
    seed : int
        Of the search.
    tries : int
        Commands tried.
    """
    signal = periodic_signal()
    time = np.arange(0.0, signal.steady[1], TICK)
    angle, velocity = signal(time)
    middle = int(_REVERSAL / TICK)
    window = slice(middle - _BEFORE, middle + _AFTER)
    desired = np.ascontiguousarray(angle[window])
    plain = _run(parameters, angle, None, 0.0)[0]
    inside = time >= signal.steady[0]
    uncompensated = float(np.sqrt(np.mean((plain - angle)[inside] ** 2)))
    _, command, states = _run(parameters, angle, velocity, 0.0)
    released, _, _ = _run(parameters, angle, velocity, PhysicalInverseSettings().share)
    model = InternalModel(parameters, 0.0, 0.0, 0.0)
    base, start = np.ascontiguousarray(command[window]), states[window.start]
    x = np.zeros(INPUTS)
    x[IN_MOTOR] = np.nan
    history = np.zeros_like(model.history)

    def cost(bumps: NDArray[np.float64]) -> float:
        return float(
            squared_error(
                start,
                model.state,
                history,
                model.packed,
                model.flags,
                x,
                base,
                bumps,
                desired,
                float(command[window.start - 1]),
            )
        )

    generator = np.random.default_rng(seed)
    bumps = np.zeros(_BEFORE // _SPACING + _AFTER // _SPACING)
    crossing = best = cost(bumps)
    for _ in range(tries):
        first, width = generator.integers(bumps.size), generator.integers(1, 5)
        tried = bumps.copy()
        size = 0.1 * 10.0 ** generator.uniform(-2.0, 0.7)
        tried[first : first + width] += size * generator.normal()
        found = cost(tried)
        if found < best:
            bumps, best = tried, found
    # One such window in each half period.
    scale = TICK / (np.pi * uncompensated**2)
    rest = float(np.sum((released[window] - desired) ** 2))
    return CrossingBound(*(float(np.sqrt(scale * s)) for s in (crossing, best, rest)))


def _run(
    parameters: PhysicalParameters,
    angle: NDArray[np.float64],
    velocity: NDArray[np.float64] | None,
    share: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[NDArray[np.float64]]]:
    """Tip angles, commands and states (before each command) on the exact plant."""
    inverse = PhysicalInverse(parameters, PhysicalInverseSettings(share=share))
    inverse.begin(0.0, 0.0, 0.0, 0.0)
    tips, commands, states = np.empty(angle.size), np.empty(angle.size), []
    for k in range(angle.size):
        tips[k] = inverse.model.tip
        states.append(inverse.model.state.copy())
        if velocity is None:
            commands[k] = angle[k]
        else:
            commands[k] = inverse.wanted(angle[k], velocity[k], TICK)
        inverse.sent(commands[k], TICK)
    return tips, commands, states
