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
    gear: float = parameter(0.5, 'shaft angle for one radian at the joint', low=0.01, high=100.0)
    joint_limit: float = parameter(
        1.75, 'largest desired bending obeyed, either way', unit='rad', low=0.1, high=3.1
    )
    drive_limit: float = parameter(
        3.0,
        'largest joint-equivalent motor angle put out, either way',
        unit='rad',
        low=0.1,
        high=10.0,
    )
    max_speed: float = parameter(30.0, 'largest speed between two commands', unit='rad/s', low=0.0)
    max_step: float = parameter(
        0.5,
        'largest distance of the first command after a pause from the last one obeyed',
        unit='rad',
        low=0.0,
    )
    command_timeout: float = parameter(
        0.1, 'a command or correction older than this is not obeyed', unit='s', low=0.001, high=1.0
    )
    calibration_timeout: float = parameter(
        0.05,
        'silence after which calibration no longer goes before the console',
        unit='s',
        low=0.001,
        high=1.0,
    )
