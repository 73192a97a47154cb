"""The simulated slave: friction along the whole sheath, and what can be added to it."""

from endoscope_core.physics.description import (
    EffectSpec,
    JointParameters,
    PlantDescription,
    SensorParameters,
    TermSpec,
)
from endoscope_core.physics.packing import recording_faults
from endoscope_core.physics.plant_file import load_plant, save_plant
from endoscope_core.physics.sensing import SensorModel
from endoscope_core.physics.simulator import PlantSample, PlantSimulator, PlantTrajectory, simulate

__all__ = [
    'EffectSpec',
    'JointParameters',
    'PlantDescription',
    'PlantSample',
    'PlantSimulator',
    'PlantTrajectory',
    'SensorModel',
    'SensorParameters',
    'TermSpec',
    'load_plant',
    'recording_faults',
    'save_plant',
    'simulate',
]
