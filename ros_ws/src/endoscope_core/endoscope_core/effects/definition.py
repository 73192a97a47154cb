"""What the catalogue says of one effect: its parameters, equation, source and place."""

import difflib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

from endoscope_core.effects.slots import SLOTS


class UnknownEffectError(ValueError):
    """An effect, its joint or one of its parameters that the catalogue does not have."""


def nearest(name: str, valid: Iterable[str]) -> str:
    """A hint that names the valid name nearest to a wrong one, and else all of them."""
    valid = list(valid)
    close = difflib.get_close_matches(name, valid, n=1, cutoff=0.5)
    return f'did you mean {close[0]}?' if close else 'valid are ' + ', '.join(valid)


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
    phase : bool
        Whether half a turn more reverses the effect.
    scale : float
        Where the effect is far from linear in this parameter, the change over which it nearly is;
        else 0.
    counted : bool
        Whether it is a whole number, which a fit steps through one by one.
    is_duration : bool
        Whether it is the length of the recording, which nobody has to look for.
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
    phase: bool = False
    scale: float = 0.0
    counted: bool = False
    is_duration: bool = False

    def __post_init__(self) -> None:
        if not self.low <= self.typical <= self.high:
            raise ValueError(f'{self.name}: typical {self.typical} is outside its bounds')
        for value in (*self.starts, *self.choices):
            if not self.low <= value <= self.high:
                raise ValueError(f'{self.name}: {value} is outside its bounds')


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

    @property
    def places(self) -> range:
        """Indices of its parameters in the compiled physics' parameter array."""
        return range(self.first_parameter, self.first_parameter + len(self.parameters))


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
        effect_id,
        stage,
        physics,
        equation,
        source,
        parameters,
        flag=SLOTS.flag(),
        first_parameter=SLOTS.parameter_block(len(parameters)),
    )
    CATALOGUE[effect_id] = definition
    return definition


def describe(effect_id: str) -> EffectDefinition:
    """The catalogue's definition of an effect.

    Raises
    ------
    UnknownEffectError
        If the catalogue has no such id; the message names the nearest.
    """
    if effect_id not in CATALOGUE:
        raise UnknownEffectError(f'unknown effect {effect_id}: {nearest(effect_id, CATALOGUE)}')
    return CATALOGUE[effect_id]
