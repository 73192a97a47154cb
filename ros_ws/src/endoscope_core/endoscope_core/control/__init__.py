"""From a hand to a command: what is desired, feed-forward and feedback."""

from endoscope_core.choices import ADAPTIVE_PHYSICAL, MODES
from endoscope_core.control.adaptive_backlash import AdaptiveBacklashSettings
from endoscope_core.control.adopted_plant import AdoptedPlant, AdoptionError, adopted_plant
from endoscope_core.control.desired_motion import DesiredMotion
from endoscope_core.control.feedforward import Feedforward, FeedforwardLaw, FeedforwardSettings
from endoscope_core.control.handle import Handle, HandleRefusal
from endoscope_core.control.internal_model import PhysicalParameters, bending_range
from endoscope_core.control.limits import MotorLimits
from endoscope_core.control.physical_inverse import PhysicalInverse
from endoscope_core.control.plant_learning import PlantLearning
from endoscope_core.control.tracker_feedback import (
    AdaptiveBacklashController,
    Corrections,
    TrackerMeasurement,
)

__all__ = [
    'ADAPTIVE_PHYSICAL',
    'MODES',
    'AdaptiveBacklashController',
    'AdaptiveBacklashSettings',
    'AdoptedPlant',
    'AdoptionError',
    'Corrections',
    'DesiredMotion',
    'Feedforward',
    'FeedforwardLaw',
    'FeedforwardSettings',
    'Handle',
    'HandleRefusal',
    'MotorLimits',
    'PhysicalInverse',
    'PhysicalParameters',
    'PlantLearning',
    'TrackerMeasurement',
    'adopted_plant',
    'bending_range',
]
