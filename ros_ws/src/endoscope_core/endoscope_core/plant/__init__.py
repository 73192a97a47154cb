"""The simulated tendon-sheath rig."""

from endoscope_core.plant.parameters import (
    EffectSpec,
    JointParameters,
    PlantDescription,
    SensorParameters,
)
from endoscope_core.plant.plant_file import PlantFileError, load_plant, save_plant
from endoscope_core.plant.recording import RecordingFaults, recording_faults
from endoscope_core.plant.sensing import SensorModel
from endoscope_core.plant.simulator import (
    PlantSample,
    PlantSimulator,
    PlantTrajectory,
    simulate,
)

__all__ = [
    'EffectSpec',
    'JointParameters',
    'PlantDescription',
    'PlantFileError',
    'PlantSample',
    'PlantSimulator',
    'PlantTrajectory',
    'RecordingFaults',
    'SensorModel',
    'SensorParameters',
    'load_plant',
    'recording_faults',
    'save_plant',
    'simulate',
]
