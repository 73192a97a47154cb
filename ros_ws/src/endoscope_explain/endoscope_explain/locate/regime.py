"""In which states of the rig a mismatch shows, in words."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.locate.conditions import GRID_S
from endoscope_explain.locate.excess import SignalExcess

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_NATS = 0.08
"""Information that a state must give about where the excess is to be worth a word."""
SHIFTS = 99


def regime_in_words(
    excesses: Sequence[SignalExcess], states: Mapping[str, Mask], seed: int = 0
) -> str:
    """Name the one or two states, of `conditions`, that hold most of the excess in least time."""
    if not states or not excesses:
        return 'throughout'
    energy = _energy_on_grid(excesses, len(next(iter(states.values()))))
    everywhere = np.ones(len(energy), bool)
    # How far a state concentrates the excess is the Kullback-Leibler divergence between its share
    # of the excess and its share of the time; by chance is what shifts of the excess in time (drawn
    # by the seed) reach.
    first = _best(energy, states, everywhere, seed)
    if first is None:
        return 'throughout'
    rest = {words: active for words, active in states.items() if words != first}
    second = _best(energy, rest, states[first], seed + 1)
    return first if second is None else f'{first}, {second}'


def information(energy: Array, active: Mask, within: Mask) -> float:
    """What a state says about where the energy (N,), >= 0, is, in nats; 0 where it holds less."""
    total = float(energy[within].sum())
    inside = active & within
    time_share = int(inside.sum()) / max(int(within.sum()), 1)
    if total <= 0.0 or not 0.02 < time_share < 0.98:
        return 0.0
    share = float(np.clip(energy[inside].sum() / total, 1e-9, 1 - 1e-9))
    if share <= time_share:
        return 0.0
    return float(
        share * np.log(share / time_share) + (1 - share) * np.log((1 - share) / (1 - time_share))
    )


def _best(energy: Array, states: Mapping[str, Mask], within: Mask, seed: int) -> str | None:
    scored = {words: information(energy, active, within) for words, active in states.items()}
    # Of states that say as much, the last one is named.
    words, value = max(reversed(scored.items()), key=lambda item: item[1])
    if value < LEAST_NATS:
        return None
    rng = np.random.default_rng(seed)
    least = int(1.0 / GRID_S)
    if len(energy) < 4 * least:
        return words
    shifts = rng.integers(least, len(energy) - least, SHIFTS)
    by_chance = [
        max(information(np.roll(energy, k), active, within) for active in states.values())
        for k in shifts
    ]
    return words if value > np.quantile(by_chance, 0.9) else None


def _energy_on_grid(excesses: Sequence[SignalExcess], size: int) -> Array:
    energy = np.zeros(size)
    for one in excesses:
        index = np.clip((one.view.time / GRID_S).astype(int), 0, size - 1)
        energy += np.bincount(index, one.missing**2, size)
    return energy
