"""A wire in its sheath: a row of springs, joined at nodes that rub (see `sliding_nodes`)."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.compiled import compiled

Array = NDArray[np.float64]
Plant = Mapping[str, Any]
"""Numbers, and the harmonics of the friction profile, by the keys of `sliding_nodes.NOMINAL`."""

MOST_SWEEPS, MOST_GUESSES = 200_000, 30
BEGUN = 1e-30  # m, slip of a node that starts to slip
SETTLED = 1e-11  # N


def move_wire(plant: Plant, motor: ArrayLike, joint: ArrayLike, cells: int) -> Array:
    """Tension (N, cells + 1) in N along a wire whose ends are displaced (N,) in m to the motor."""
    grip, springs, tension = wire_of(plant, cells)
    motor, joint = np.asarray(motor, dtype=float), np.asarray(joint, dtype=float)
    along = np.empty((len(motor), cells + 1))
    along[0] = tension
    if not _move_wire(motor, joint, grip, springs, np.zeros(cells + 2), along):
        raise RuntimeError('nodes of a wire did not settle')
    return along


def wire_of(plant: Plant, cells: int) -> tuple[Array, Array, Array]:
    """Greatest ratios of tension over the nodes, springs in N/m, tension in N at the start."""
    # Far finer than the nodes, at midpoints: the density of friction is smooth.
    fine = 200
    place = (np.arange(cells * fine) + 0.5) / (cells * fine)
    harmonics = np.atleast_1d(np.asarray(plant['friction_profile'], dtype=float))
    order = np.arange(1, len(harmonics) + 1)
    density = np.exp(np.cos(np.pi * np.outer(place, order)) @ harmonics)
    share = density.reshape(cells, fine).sum(axis=1) / density.sum()
    exponent = float(plant['capstan_exponent']) * share
    springs = np.full(cells + 1, float(plant['wire_stiffness']) * cells)
    springs[[0, -1]] *= 2.0
    passed = np.concatenate([[0.0], np.cumsum(exponent)])
    # A spring spans the stretch between two nodes, the first and the last one half of that; its
    # tension stands at the middle of that stretch, or at the wire's end.
    tension = float(plant['pretension']) * np.exp(-float(plant['pretension_profile']) * passed)
    return np.exp(exponent), springs, tension


@compiled
def _guess(before: Array, slip: Array, grip: Array, springs: Array, scratch: Array) -> None:
    """Guess the slip of all nodes: start from those that slipped, and correct wrong ones."""
    # For a known set of slipping nodes and directions, the slips follow from linear equations
    # between neighbours, by elimination (Thomas 1949). The sweeps check and correct the guess.
    nodes = len(grip)
    for _ in range(MOST_GUESSES):
        scratch[0] = 0.0
        for j in range(1, nodes + 1):
            low, middle, high, right = 0.0, 1.0, 0.0, 0.0
            if slip[j] != 0.0:
                # Ratio of the tensions on either side of the node.
                ratio = grip[j - 1] if slip[j] > 0.0 else 1.0 / grip[j - 1]
                low, high = -springs[j - 1], -ratio * springs[j]
                middle, right = -low - high, before[j - 1] - ratio * before[j]
            pivot = middle - low * scratch[j - 1]
            scratch[j] = high / pivot
            slip[j] = (right - low * slip[j - 1]) / pivot
        for j in range(nodes, 0, -1):
            slip[j] -= scratch[j] * slip[j + 1]
        erred, behind = False, slip[0]
        for j in range(1, nodes + 1):
            here, ratio = slip[j], grip[j - 1]
            left = before[j - 1] + springs[j - 1] * (behind - here)
            right = before[j] + springs[j] * (here - slip[j + 1])
            behind = here
            if here * (left - right) < 0.0:
                slip[j], erred = 0.0, True
            elif here == 0.0 and max(left, right) > ratio * min(left, right):
                slip[j], erred = math.copysign(BEGUN, left - right), True
        if not erred:
            return


@compiled
def _relax(before: Array, slip: Array, grip: Array, springs: Array, tension: Array) -> bool:
    """Find the slip of all nodes of a taut wire for given slips of its ends; writes `tension`."""
    # Every node stays where it was at the start of the tick if the springs next to it allow that;
    # otherwise it slips just as far as needed. Sweeps over the nodes until none moves, with
    # over-relaxation (projected, Cryer 1971, so that no node overshoots its start).
    nodes = len(grip)
    _guess(before, slip, grip, springs, tension)
    for i in range(nodes + 1):
        tension[i] = before[i] + springs[i] * (slip[i] - slip[i + 1])
    factor = 2.0 / (1.0 + math.sin(math.pi / nodes))
    for sweep in range(MOST_SWEEPS):
        # If over-relaxation cycles, continue with the plain, slower method.
        over = factor if sweep < MOST_SWEEPS // 10 else 1.0
        most = 0.0
        for j in range(1, nodes + 1):
            left, right, ratio = springs[j - 1], springs[j], grip[j - 1]
            stuck_left = tension[j - 1] + left * slip[j]
            stuck_right = tension[j] - right * slip[j]
            new = 0.0
            if stuck_left > stuck_right and stuck_left > ratio * stuck_right:
                holds = (stuck_left - ratio * stuck_right) / (left + ratio * right)
                new = max(slip[j] + over * (holds - slip[j]), 0.0)
            elif stuck_right > stuck_left and stuck_right > ratio * stuck_left:
                holds = (ratio * stuck_left - stuck_right) / (ratio * left + right)
                new = min(slip[j] + over * (holds - slip[j]), 0.0)
            moved = new - slip[j]
            slip[j] = new
            tension[j - 1] -= left * moved
            tension[j] += right * moved
            most = max(most, abs(moved) * max(left, right))
        if most < SETTLED:
            return True
    return False


@compiled
def pull(
    extension: float,
    motor: float,
    joint: float,
    before: Array,
    slip: Array,
    grip: Array,
    springs: Array,
    tension: Array,
) -> bool:
    """Move both ends of a wire by `motor` and `joint` in m; a negative extension is slack."""
    after = extension + motor - joint
    if after <= 0.0:
        tension[:] = 0.0
        return True
    # Only the part of the motion after the slack is taken up stretches the wire.
    taut = 1.0 if extension >= 0.0 else after / (after - extension)
    slip[0], slip[-1] = taut * motor, taut * joint
    return _relax(before, slip, grip, springs, tension)


@compiled
def _move_wire(
    motor: Array, joint: Array, grip: Array, springs: Array, slip: Array, along: Array
) -> bool:
    """Tension (N, cells + 1) in N along a wire whose ends are displaced (N,) in m to the motor."""
    extension = 0.0
    for i in range(len(springs)):
        extension += along[0, i] / springs[i]
    for k in range(1, len(motor)):
        at_motor, at_joint = motor[k] - motor[k - 1], joint[k] - joint[k - 1]
        if not pull(extension, at_motor, at_joint, along[k - 1], slip, grip, springs, along[k]):
            return False
        extension += at_motor - at_joint
    return True
