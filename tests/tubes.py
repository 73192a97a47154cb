"""Instruments in tubes of known backlash size, which no data set holds."""

import math

import numpy as np

from endoscope_core.physics import save_plant
from endoscope_lab.dataset import configuration_of_size, random_instrument


def tube_of_size(folder, size_deg, seed):
    """Write a plant file; parameters by node that make the simulated slave that plant.

    Instruments are drawn until one has that size in some tube.
    """
    generator = np.random.default_rng(seed)
    configuration = None
    while configuration is None:
        configuration = configuration_of_size(random_instrument(generator), math.radians(size_deg))
    return slave_of(configuration.plant, folder / 'plant.yaml')


def slave_of(plant, path):
    """Write a plant file; parameters by node that make the simulated slave that plant."""
    save_plant(plant, path)
    # The first node of a process reads it for all.
    return {'motor_driver': {'plant_file': str(path)}}
