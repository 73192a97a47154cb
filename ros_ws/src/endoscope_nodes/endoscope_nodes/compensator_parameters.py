"""Parameters of the compensator."""

from dataclasses import dataclass

from endoscope_core.control import MODES
from endoscope_core.identification.law_choice import BY_CLASS, SELECTIONS
from endoscope_nodes.parameters import parameter


@dataclass(frozen=True)
class CompensatorParameters:
    """What the compensator can be told."""

    mode: str = parameter(
        'bouc_wen',
        'feed-forward model in force once its parameters are known',
        choices=MODES,
        dynamic=True,
    )
    selected_by: str = parameter(
        BY_CLASS,
        'what of a calibration selects the parameters: the hysteresis class, the backlash size in '
        'the updated table, or (physical modes) the plant that it identified',
        choices=SELECTIONS,
        dynamic=True,
    )
    table: str = parameter(
        '',
        'updated table as `endoscope identify --table` extends it; empty for one made of the '
        'class parameters',
    )
    parameter_sets: str = parameter(
        '',
        'file with a parameter set for each class, as `endoscope identify` writes it; empty '
        'for the one that comes with the project',
    )
    lead: float = parameter(
        0.06,
        "time by which the desired angle is foreseen: the servo's own lag",
        unit='s',
        low=0.0,
        high=0.5,
    )
