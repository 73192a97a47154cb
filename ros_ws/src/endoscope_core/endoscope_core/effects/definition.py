"""What the catalogue says of one effect: its parameters, equation, source and place."""

import math
from dataclasses import dataclass
from enum import StrEnum

from endoscope_core.effects.slots import SLOTS


class Stage(StrEnum):
    """Part of the chain from command to recording in which an effect acts."""

    ACTUATOR = 'actuator'
    TRANSMISSION = 'transmission'
    JOINT = 'joint'
    SENSING = 'sensing'
    RECORDING = 'recording'


@dataclass(frozen=True)
class EffectParameter:
    """One parameter of an effect.

    Attributes
    ----------
    name, unit : str
        Name in plant.yaml and SI unit.
    low, high : float
        Bounds within which the physics is defined and a fit may move.
    typical : float
        Value where plant.yaml gives none.
    off : float
        Value at which the effect vanishes, or NaN where no value of this parameter does that.
    choices : tuple of float
        All admissible values of a parameter that is not continuous (a wire's number); else empty.
    starts : tuple of float
        Where a fit begins; the typical value if empty.
    comparable : bool
        Whether a person could measure the parameter another way.
    """

    name: str
    unit: str
    low: float
    high: float
    typical: float
    off: float = math.nan
    choices: tuple[float, ...] = ()
    starts: tuple[float, ...] = ()
    comparable: bool = False

    def __post_init__(self) -> None:
        if not self.low <= self.typical <= self.high:
            raise ValueError(f'{self.name}: typical {self.typical} is outside its bounds')


@dataclass(frozen=True)
class EffectDefinition:
    """An effect of the catalogue.

    Attributes
    ----------
    id : str
        Name in the catalogue.
    stage : Stage
        Where in the chain it acts.
    physics, equation, source : str
        In words, as an equation, and the literature it comes from.
    parameters : tuple of EffectParameter
        In the order of their slots.
    flag, first_parameter : int
        Indices in the compiled physics' flag and parameter arrays.
    """

    id: str
    stage: Stage
    physics: str
    equation: str
    source: str
    parameters: tuple[EffectParameter, ...]
    flag: int
    first_parameter: int


CATALOGUE: dict[str, EffectDefinition] = {}


def define(
    effect_id: str,
    stage: Stage,
    *,
    physics: str,
    equation: str,
    source: str,
    parameters: tuple[EffectParameter, ...],
) -> EffectDefinition:
    """Add an effect to the catalogue and give it its flag and parameter slots.

    Raises
    ------
    ValueError
        If the id is taken.
    """
    if effect_id in CATALOGUE:
        raise ValueError(f'effect {effect_id} is defined twice')
    definition = EffectDefinition(
        effect_id, stage, physics, equation, source, parameters,
        flag=SLOTS.flag(), first_parameter=SLOTS.parameter_block(len(parameters)),
    )
    CATALOGUE[effect_id] = definition
    return definition
