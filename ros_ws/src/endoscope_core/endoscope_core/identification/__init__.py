"""Parameters of hysteresis models from recordings."""

from endoscope_core.identification.class_parameters import (
    ClassParameterError,
    class_parameter_sets,
    identify_classes,
    load_class_parameters,
    parameters_for_class,
)
from endoscope_core.identification.feedforward_fit import FeedforwardFit, fit_feedforward
from endoscope_core.identification.hysteresis_fit import (
    IdentificationError,
    ModelFit,
    Recording,
    closed_cycle,
    fit_model,
)
from endoscope_core.identification.servo_lag import Servo

__all__ = [
    'ClassParameterError',
    'FeedforwardFit',
    'IdentificationError',
    'ModelFit',
    'Recording',
    'Servo',
    'class_parameter_sets',
    'closed_cycle',
    'fit_feedforward',
    'fit_model',
    'identify_classes',
    'load_class_parameters',
    'parameters_for_class',
]
