"""The smallest force at the tip that is seen, by the bend of the tube and of the tip."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from endoscope_core.names import JOINTS
from endoscope_core.physics import PlantDescription
from endoscope_core.physics.family import shipped_family
from endoscope_core.rig import shipped_rig
from endoscope_core.tip_force import TipForceEstimator
from endoscope_lab.bench import side_by_side, table_head, table_row
from endoscope_lab.concealed import motions, readings
from endoscope_lab.touch.touched_rig import compensated, teleoperation, watched

TUBES_DEG = (0, 60, 120, 180, 240)
"""Bends of the real tubes that the family was fitted to."""
BENT_DEG = (0, 20, 40, 60)
_NEAR_DEG = 10.0
_MOVING_DEG = 0.05
"""In a block; 2 deg/s."""
_HANDS = 4
"""Motions of a hand, 30 s each; the first one is left out, after which bounds are learnt."""


@dataclass(frozen=True)
class Visible:
    """Smallest forces that are seen in one tube, in N: medians near each of `BENT_DEG`."""

    tube_deg: int
    moving: tuple[float, ...]
    standing: tuple[float, ...]


def run(seed: int, jobs: int) -> None:
    """Print the table of all tubes."""
    head = (f'bent by {bent} deg' for bent in BENT_DEG)
    print(table_head('tube, deg', *head))
    calls = [(tube, seed) for tube in TUBES_DEG]
    found = {tube: future.result() for (tube, _), future in side_by_side(jobs, visible, calls)}
    for tube in TUBES_DEG:
        print(table_row(tube, *_cells(found[tube])))
    print('N, medians while the tip moves, and while it stands still.')


def _cells(of_tube: Visible) -> Sequence[str]:
    both = zip(of_tube.moving, of_tube.standing, strict=True)
    return [
        '-' if math.isnan(moving) else f'{moving:.3f}, {standing:.3f}' for moving, standing in both
    ]


def visible(tube_deg: int, seed: int) -> Visible:
    """Of a rig that is its plant, teleoperated in free space."""
    with threadpool_limits(1):
        generator = np.random.default_rng([seed, tube_deg])
        joint = shipped_family().joint(math.radians(tube_deg))
        plant = PlantDescription(joints={JOINTS[0]: joint})
        asked = teleoperation(generator, 1, _HANDS)
        clean = readings.read(plant, compensated(plant, asked))
        recording = readings.as_sensed(clean, JOINTS[:1], plant.sensors, seed)
        estimator = TipForceEstimator(plant, shipped_rig().instrument.section_length)
        estimator.free = True
        forces = [f for f in watched(estimator, recording, 0.0) if f.time > motions.HAND_S]
        at = [force.time for force in forces]
        angle = np.degrees(np.interp(at, clean.tracker_time, clean.bending[:, 0]))
        seen = np.array([force.visible for force in forces])
        moves = np.abs(np.gradient(angle)) > _MOVING_DEG

        def median(bent: int, chosen: NDArray[np.bool_]) -> float:
            near = chosen & (np.abs(np.abs(angle) - bent) < _NEAR_DEG)
            return float(np.median(seen[near])) if near.any() else math.nan

        moving, standing = ([median(b, c) for b in BENT_DEG] for c in (moves, ~moves))
        return Visible(tube_deg, tuple(moving), tuple(standing))
