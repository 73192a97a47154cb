"""Calibration tensions of a kind that no data set holds, to be refused rather than judged."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.dataset import record_calibration
from endoscope_core.physics import EffectSpec, PlantDescription, SensorModel, simulate
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import CALIBRATION_RATE, CalibrationMotion

Array = NDArray[np.float64]
Generator = np.random.Generator


def slack_wires(generator: Generator, plant: PlantDescription, motion: CalibrationMotion) -> Array:
    """Both wires of one joint are longer than their pretension takes up."""
    joint = str(generator.choice(list(plant.joints)))
    slack = EffectSpec('wire_slack', joint, {'length_m': generator.uniform(1e-3, 2e-3)})
    return _tension(generator, replace(plant, effects=(*plant.effects, slack)), motion)


def broken_cell(generator: Generator, plant: PlantDescription, motion: CalibrationMotion) -> Array:
    """One cell no longer answers to its wire: it stays where it was, or at zero with its noise."""
    tension = _tension(generator, plant, motion)
    wire = generator.integers(tension.shape[1])
    if generator.random() < 0.5:
        tension[:, wire] = tension[0, wire]
    else:
        noise = generator.normal(0.0, plant.sensors.load_cell_noise, len(tension))
        tension[:, wire] = noise
    return tension


def saturated_cell(
    generator: Generator, plant: PlantDescription, motion: CalibrationMotion
) -> Array:
    """One cell clips at 60 to 90 % of what its wire reaches."""
    tension = _tension(generator, plant, motion)
    wire = generator.integers(tension.shape[1])
    limit = generator.uniform(0.6, 0.9) * np.max(tension[:, wire])
    tension[:, wire] = np.minimum(tension[:, wire], limit)
    return tension


def other_motion(generator: Generator, plant: PlantDescription, motion: CalibrationMotion) -> Array:
    """The motors did something else: a smaller or slower motion, one joint only, or none."""
    time = np.arange(motion.samples) / CALIBRATION_RATE
    reach = np.ones(len(plant.joints))
    pace = 1.0
    kind = generator.integers(4)
    if kind == 0:
        reach *= generator.uniform(0.4, 0.8)
    elif kind == 1:
        pace = generator.uniform(0.5, 0.8)
    elif kind == 2:
        reach[generator.integers(len(reach))] = 0.0
    else:
        reach *= 0.0
    command = shipped_rig().joints.gear * motion.signal(pace * time)[0][:, None] * reach
    wires = simulate(plant, command).tension.reshape(len(time), -1)
    return SensorModel(plant.sensors, int(generator.integers(2**31))).tension(wires)


def exchanged_cells(
    generator: Generator, plant: PlantDescription, motion: CalibrationMotion
) -> Array:
    """The cables of the two cells of one joint are plugged in the wrong way round."""
    tension = _tension(generator, plant, motion)
    first = 2 * int(generator.integers(tension.shape[1] // 2))
    tension[:, [first, first + 1]] = tension[:, [first + 1, first]]
    return tension


UNUSUAL: dict[str, Callable[[Generator, PlantDescription, CalibrationMotion], Array]] = {
    'slack wires': slack_wires,
    'broken load cell': broken_cell,
    'saturated load cell': saturated_cell,
    'other motion': other_motion,
    'exchanged load cells': exchanged_cells,
}
"""Tensions in N (N, 4) in the order of the data set, by what is unusual about them."""


def _tension(generator: Generator, plant: PlantDescription, motion: CalibrationMotion) -> Array:
    return record_calibration(plant, int(generator.integers(2**31)), motion).tension
