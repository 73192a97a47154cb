"""What an effect is: its parameters, equation, source, place, and what a search must know of it."""

import importlib
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.layout import NOMINAL_KEYS, SLOTS


class Stage(StrEnum):
    """Part of the chain from command to recording in which an effect acts."""

    ACTUATOR = 'actuator'
    TRANSMISSION = 'transmission'
    JOINT = 'joint'
    SENSING = 'sensing'
    RECORDING = 'recording'


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect, in SI units."""

    name: str  # in plant.yaml
    unit: str
    # Bounds within which the physics is defined and a fit may move.
    low: float
    high: float
    typical: float  # where plant.yaml gives none
    off: float = math.nan  # at which the effect vanishes; NaN where no value does that
    # All admissible values of a parameter that is not continuous (a wire's number); else empty.
    choices: tuple[float, ...] = ()
    # What each choice, or each whole number from `low` on, stands for.
    words: tuple[str, ...] = ()
    starts: tuple[float, ...] = ()  # where a fit begins; the typical value if empty
    comparable: bool = False  # a person could measure it another way
    phase: bool = False  # half a turn more reverses the effect
    # Where the effect is far from linear in it, the change over which it nearly is; else 0.
    scale: float = 0.0
    counted: bool = False  # a whole number, which a fit steps through one by one
    is_duration: bool = False  # the length of the recording, which nobody has to look for

    def __post_init__(self) -> None:
        if not self.low <= self.typical <= self.high:
            raise ValueError(f'{self.name}: typical {self.typical} is outside its bounds')
        for value in (*self.starts, *self.choices):
            if not self.low <= value <= self.high:
                raise ValueError(f'{self.name}: {value} is outside its bounds')
        if self.is_switch and len(self.words) != len(self.admissible):
            raise ValueError(f'{self.name}: give a word for each of its values')

    @property
    def is_switch(self) -> bool:
        """Whether it chooses a form: it is no number that a person could measure."""
        return bool(self.choices) or self.counted

    @property
    def admissible(self) -> tuple[float, ...]:
        """All values of a switch."""
        return self.choices or tuple(range(int(self.low), int(self.high) + 1))

    def in_words(self, value: float) -> str:
        """What a value of a switch stands for."""
        nearest = min(self.admissible, key=lambda choice: abs(choice - value))
        return self.words[self.admissible.index(nearest)]


class Symptom(StrEnum):
    """What a recording itself shows of an effect, without any simulation."""

    CLIPPED_TENSION = 'tension that stands at a limit'
    MISSING_SAMPLES = 'samples that are missing'
    CLOCK_RATE = 'stamps of a clock that runs fast or slow'
    WRONG_SAMPLES = 'isolated angles that no joint can have'


@dataclass(frozen=True)
class Traits:
    """What a search for missing physics must know of an effect."""

    depends_on_time: bool = False  # distinguished from others only where a motion is made twice
    of_device: bool = False  # belongs to a device that all joints share
    of_shape: bool = False  # belongs to the tube's shape, and is another in each recording
    rugged: bool = False  # many valleys: a fit needs many starts and wide difference steps
    audited: bool = False  # no simulation shows it: it is found in the recording itself
    symptom: Symptom | None = None  # by which the recording itself shows it
    # What it does is confounded with a change with time where a motion is made once.
    resembles_time: bool = False
    # Nominal parameter that it scales by so much that a described value is ambiguous, and by how
    # much.
    rescales: tuple[str, float] | None = None
    families: tuple[str, ...] = ()  # places whose functions hold its formula as one of many


@dataclass(frozen=True)
class Effect:
    """An effect of the catalogue, which it enters when created; a subclass has its own mapping."""

    id: str  # in the catalogue; a ValueError if it is taken
    stage: Stage
    order: int  # among those of its stage: the smaller, the earlier in the chain
    physics: str  # in words
    equation: str
    source: str  # the literature it comes from
    parameters: tuple[Parameter, ...]  # in the order of their slots
    traits: Traits = Traits()
    # Indices in the compiled physics' flag and parameter arrays.
    flag: int = field(default_factory=SLOTS.flag)
    first_parameter: int = field(init=False)

    def __post_init__(self) -> None:
        if self.id in _DEFINED:
            raise ValueError(f'effect {self.id} is defined twice')
        object.__setattr__(self, 'first_parameter', self._block())
        _DEFINED[self.id] = self

    def _block(self) -> int:
        return SLOTS.parameter_block(len(self.parameters))

    def __reduce__(self) -> tuple[Callable[[str], 'Effect'], tuple[str]]:
        # By its id: a process that it is sent to has it already, with its compiled functions.
        return _defined, (self.id,)

    @property
    def places(self) -> range:
        """Indices of its parameters in the compiled physics' parameter array."""
        return range(self.first_parameter, self.first_parameter + len(self.parameters))


@dataclass(frozen=True)
class NominalPhysics(Effect):
    """Physics of the nominal plant that a simulation may lack, as one of a rigid wire does.

    Its parameters are nominal ones, under their own names and next to each other in the order of
    `NOMINAL_KEYS`; a joint lacks it where the first of them is `off`.
    """

    in_every_rig: bool = True  # that a rig has none is no hypothesis

    def _block(self) -> int:
        return NOMINAL_KEYS.index(self.parameters[0].name)

    def is_lacking(self, packed: NDArray[np.float64]) -> bool:
        """Whether a joint of these packed parameters (parameters,) lacks it."""
        return bool(packed[self.first_parameter] == self.parameters[0].off)


_DEFINED: dict[str, Effect] = {}


def _defined(effect_id: str) -> Effect:
    for room in ('effects', 'functions'):
        importlib.import_module(f'endoscope_core.physics.{room}')
    return _DEFINED[effect_id]


def in_order_of_chain[Kind: Effect](kind: type[Kind]) -> dict[str, Kind]:
    """All effects of exactly that class defined so far by their ids, in the order of the chain.

    Those of one stage and order come as they were defined.
    """
    stages = list(Stage)
    found = [effect for effect in _DEFINED.values() if type(effect) is kind]
    ordered = sorted(found, key=lambda effect: (stages.index(effect.stage), effect.order))
    return {effect.id: effect for effect in ordered}
