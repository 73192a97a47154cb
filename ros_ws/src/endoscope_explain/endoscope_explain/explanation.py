"""What `explain_recording` finds out, as plain frozen data that a report is written from."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import PlantDescription, TermSpec
from endoscope_core.physics.effect import Effect
from endoscope_core.physics.effects import describe
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.place import Place

Array = NDArray[np.float64]

LEAST_EXPLAINED = 0.05
"""A function that takes away less of the excess misfit than this is not offered as what acts."""


class Verdict(StrEnum):
    """The one-word answer."""

    CONSISTENT = 'consistent'
    PARAMETERS_DIFFER = 'parameters_differ'
    MISSING_PHYSICS = 'missing_physics'
    SENSOR_FAULT = 'sensor_fault'
    RECORDING_FAULT = 'recording_fault'
    UNKNOWN_PHYSICS = 'unknown_physics'
    INSUFFICIENT_DATA = 'insufficient_data'


@dataclass(frozen=True)
class Estimate:
    """A fitted number with its 90 % interval.

    `value`, `low`, `high`: in `unit`; `low <= value <= high`.
    `unit`: SI unit.
    """

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class NominalEstimate(Estimate):
    """A refitted parameter of the nominal plant.

    `nominal`: value in the plant file.
    `in_band`: whether the value is within the tolerance by which rigs differ from their
        description.
    """

    nominal: float
    in_band: bool


@dataclass(frozen=True)
class NamedEffect:
    """One effect that was left out of the simulation.

    `id`, `joint`: catalogue id and joint name.
    `parameters`: fitted parameters by name.
    `alternatives`: ids that the data cannot tell from this one, nearest first.
    `evidence`: each key has its meaning in `report.sentences.EVIDENCE`.
    """

    id: str
    joint: str
    parameters: Mapping[str, Estimate]
    alternatives: tuple[str, ...] = ()
    evidence: Mapping[str, float] = field(default_factory=dict)

    @property
    def definition(self) -> Effect:
        """The catalogue's effect: its physics, equation, source and parameters."""
        return describe(self.id)

    @property
    def stage(self) -> str:
        """Part of the chain from command to recording."""
        return str(self.definition.stage)


@dataclass(frozen=True)
class ChannelFit:
    """How well one signal is predicted on samples that were not used for fitting.

    `rmse`: in the signal's unit.
    `noise`: noise of the signal, in the same unit.
    `ratio`: `rmse / noise`; 1 where nothing is left but noise.
    """

    rmse: float
    noise: float

    @staticmethod
    def of(left: Array, noise: Array) -> 'ChannelFit':
        """What is left (M,) of a signal, beside the noise of its samples (M,)."""
        return ChannelFit(float(np.sqrt(np.mean(left**2))), float(np.sqrt(np.mean(noise**2))))

    @property
    def ratio(self) -> float:
        """Misfit in units of the noise."""
        return self.rmse / self.noise


@dataclass(frozen=True)
class Fitting:
    """How the fit of a joint ended.

    `converged`: whether further steps would gain nothing.
    `reason`: why it went no further, in words.
    `steps`: of the last fit.
    `at_bounds`: numbers that lie at an end of what is allowed.
    """

    converged: bool
    reason: str
    steps: int
    at_bounds: tuple[str, ...]


@dataclass(frozen=True)
class Candidate:
    """One composition of effects that was tried.

    `effects`: and places of functions.
    `score`: logarithm of the evidence that it lacks against no effect, in nats; smaller is better.
    `misfit`: mean squared residual in noise units over all channels; 1 is noise alone.
    `beyond_band`: whether nominal numbers were let leave their band.
    """

    joint: str
    effects: tuple[str, ...]
    score: float
    misfit: float
    beyond_band: bool = False


@dataclass(frozen=True)
class UnknownTerm:
    """A function of one state that the catalogue does not have, fitted in the simulator.

    `joint`: where it acts.
    `place`: name in the table of places.
    `nodes`, `values`, `deviation` (N,): the state, the function and its standard deviation.
    `expression`: the formula that comes nearest.
    `formula` (N,): its values.
    `formula_share`: share of what the function does that the formula does.
    `formula_is_as_good`: whether the recording does not tell it from the function.
    `explained`: share of the excess misfit that the function removes.
    `rivals`: other names that the recording does not tell from it, nearest first.
    `siblings`: nearest effects of the catalogue, nearest first.
    `multiplies`: whether others at the same point of the chain are multiplied by one plus this
        function.
    `lag_s`: time constant of an argument that lags.
    `factors`: functions of another state that multiply this one: both together are one of two
        states.
    """

    joint: str
    place: str
    nodes: Array
    values: Array
    deviation: Array
    expression: str
    formula: Array
    formula_share: float
    formula_is_as_good: bool
    explained: float = 1.0
    rivals: tuple[str, ...] = ()
    siblings: tuple[str, ...] = ()
    multiplies: bool = False
    lag_s: float | None = None
    factors: tuple['UnknownTerm', ...] = ()

    @property
    def there(self) -> Place:
        """The place: its stage, what the function does, its unit and its argument."""
        return FUNCTIONS[self.place]

    @property
    def helps(self) -> bool:
        """Whether the function explains enough to be offered."""
        return self.explained >= LEAST_EXPLAINED

    def term(self) -> TermSpec:
        """As a plant has it: the formula where it is as good, else the function's values."""
        ends = float(self.nodes[0]), float(self.nodes[-1])
        term = TermSpec(
            self.joint, self.place, range=ends, multiplies=self.multiplies, lag_s=self.lag_s
        )
        if self.formula_is_as_good:
            return replace(term, expression=self.expression)
        return replace(term, values=tuple(self.values.tolist()))


@dataclass(frozen=True)
class Explanation:
    """Everything the engine says about one recording.

    `verdict`: without the audit's findings: a caller that found a fault of the recording overrides
        it.
    `effects`: what was left out, most certain first; empty if nothing was.
    `parameters`: nominal parameters of the final fit.
    `nominal`, `refitted`, `augmented`: the plant as given, with its parameters refitted, and with
        the named effects.
    `fit`: signals are written `wires/measured_js:wire_x_pos`.
    `candidates`: compositions that were refitted, best first.
    `unknown`: the missing term for `unknown_physics`.
    `adequate`: whether the augmented plant leaves nothing but noise and small errors of form.
    `beyond_form`: what it leaves over what rigs of another form leave, of the worst joint.
    `fitting`: how the final fits ended.
    """

    verdict: Verdict
    effects: tuple[NamedEffect, ...]
    parameters: Mapping[str, Mapping[str, NominalEstimate]]
    nominal: PlantDescription
    refitted: PlantDescription
    augmented: PlantDescription
    fit: Mapping[str, Mapping[str, ChannelFit]]
    candidates: tuple[Candidate, ...] = ()
    unknown: UnknownTerm | None = None
    adequate: bool = True
    beyond_form: float = math.nan
    fitting: Mapping[str, Fitting] = field(default_factory=dict)

    @staticmethod
    def without_fit(verdict: Verdict, plant: PlantDescription) -> 'Explanation':
        """What is said where nothing may be fitted, or nothing can be."""
        return Explanation(verdict, (), {}, plant, plant, plant, {})
