"""Parameters of hysteresis models from recordings."""

from endoscope_core.identification.class_parameters import (
    ClassParameterError,
    class_parameter_sets,
    identify_classes,
    load_class_parameters,
    parameters_for_class,
)
from endoscope_core.identification.feedforward_fit import FeedforwardFit, Servo, fit_feedforward
from endoscope_core.identification.hysteresis_fit import (
    IdentificationError,
    ModelFit,
    Recording,
    fit_model,
)
from endoscope_core.identification.plant_fit import PlantFit, PlantFitError, fit_plant
from endoscope_core.identification.updated_table import (
    KINDS,
    LawParameters,
    TableEntry,
    UpdatedTable,
    UpdatedTableError,
    blend,
)

__all__ = [
    'KINDS',
    'ClassParameterError',
    'FeedforwardFit',
    'IdentificationError',
    'LawParameters',
    'ModelFit',
    'PlantFit',
    'PlantFitError',
    'Recording',
    'Servo',
    'TableEntry',
    'UpdatedTable',
    'UpdatedTableError',
    'blend',
    'class_parameter_sets',
    'fit_feedforward',
    'fit_model',
    'fit_plant',
    'identify_classes',
    'load_class_parameters',
    'parameters_for_class',
]
