"""Parameters of hysteresis models from recordings."""

from endoscope_core.identification.feedforward_fit import Servo, fit_feedforward
from endoscope_core.identification.hysteresis_fit import HysteresisRecording, fit_model
from endoscope_core.identification.plant_fit import PlantFit, PlantFitError, fit_plant
from endoscope_core.identification.updated_table import (
    KINDS,
    TableEntry,
    UpdatedTable,
    blend,
    load_class_parameters,
    parameters_for_class,
)

__all__ = [
    'KINDS',
    'HysteresisRecording',
    'PlantFit',
    'PlantFitError',
    'Servo',
    'TableEntry',
    'UpdatedTable',
    'blend',
    'fit_feedforward',
    'fit_model',
    'fit_plant',
    'load_class_parameters',
    'parameters_for_class',
]
