"""Rigs in tubes of known backlash size, which no data set holds."""

import math

import numpy as np

from endoscope_core.dataset import configuration_of_size, random_rig
from endoscope_core.physics import save_plant

NODES_WITH_A_PLANT = ('motor_driver', 'load_cells', 'em_tracker')


def tube_of_size(folder, size_deg, seed):
    """Write a plant file; parameters by node that make the simulated slave that plant."""
    rig = random_rig(np.random.default_rng(seed))
    configuration = configuration_of_size(rig, math.radians(size_deg))
    path = folder / 'plant.yaml'
    save_plant(configuration.plant, path)
    return {node: {'plant_file': str(path)} for node in NODES_WITH_A_PLANT}
