"""What `explain_recording` finds out, as plain frozen data that a report is written from."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from endoscope_core.physics.description import PlantDescription, TermSpec
from endoscope_core.physics.effect import Effect
from endoscope_core.physics.effects import describe
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import Place
from endoscope_explain.prediction_set import OTHER_NUMBERS, Array, Contest, Posterior

NINETY_PERCENT = 1.645
"""Standard deviations that hold 90 % of a normal distribution, either way."""
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
    """A fitted number with its 90 % interval, `low <= value <= high`, in an SI unit."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class NominalEstimate(Estimate):
    """A refitted parameter of the nominal plant."""

    nominal: float  # value in the plant file
    in_band: bool  # within the tolerance by which rigs differ from their description
    # Whether the recording adds to what was known of it; else the interval is the prior's.
    shown: bool = True
    together_with: str = ''  # number without which the recording does not show this one
    at_bound: bool = False  # as far as it may go: the recording asks for more


@dataclass(frozen=True)
class NamedEffect:
    """One effect that was left out of the simulation."""

    id: str  # in the catalogue
    joint: str
    parameters: Mapping[str, Estimate]  # by name
    alternatives: tuple[str, ...] = ()  # ids that are confounded with this one, nearest first
    # each key has its meaning in `report.sentences.EVIDENCE`
    evidence: Mapping[str, float] = field(default_factory=dict)
    # How often names as clear as this one are right, as measured; NaN where that was not.
    probability: float = math.nan
    contest: Contest | None = None  # names that were tried in its place; None of given physics
    # A second recording is predicted no better with it.
    doubtful: bool = False

    @property
    def definition(self) -> Effect:
        """The catalogue's effect: its physics, equation, source and parameters."""
        return describe(self.id)

    @property
    def stage(self) -> str:
        """Part of the chain from command to recording."""
        return str(self.definition.stage)

    @property
    def left_open(self) -> Posterior:
        """The set of names that holds the truth with 90 %; empty where no other was tried."""
        return {} if self.contest is None else self.contest.left_open(self.id)


@dataclass(frozen=True)
class ChannelFit:
    """How well one signal is predicted on samples that were not used for fitting."""

    rmse: float  # in the signal's unit
    noise: float  # of the signal, in the same unit

    @staticmethod
    def of(left: Array, noise: Array) -> 'ChannelFit':
        """What is left (M,) of a signal, beside the noise of its samples (M,)."""
        return ChannelFit(float(np.sqrt(np.mean(left**2))), float(np.sqrt(np.mean(noise**2))))

    @property
    def ratio(self) -> float:
        """Misfit in units of the noise; 1 where nothing is left but noise."""
        return self.rmse / self.noise


@dataclass(frozen=True)
class Fitting:
    """How the fit of a joint ended."""

    converged: bool  # further steps would gain nothing
    reason: str  # why it went no further, in words
    steps: int  # of the last fit
    at_bounds: tuple[str, ...]  # numbers that are at a bound


@dataclass(frozen=True)
class Tried:
    """One combination of effects that was tried."""

    joint: str
    effects: tuple[str, ...]  # and places of functions
    # Logarithm of the evidence that it lacks against no effect, in nats; smaller is better.
    score: float
    # Mean squared residual in noise units over all channels; 1 is noise alone.
    misfit: float
    beyond_band: bool = False  # nominal numbers were let leave their band


@dataclass(frozen=True)
class UnknownTerm:
    """A function of one state that the catalogue does not have, fitted in the simulator."""

    joint: str  # where it acts
    place: str  # name in the table of places
    nodes: Array  # (N,), the state
    values: Array  # (N,), the function
    deviation: Array  # (N,), its standard deviation
    expression: str  # the formula that comes nearest
    formula: Array  # (N,), its values
    formula_share: float  # share of what the function does that the formula does
    formula_is_as_good: bool  # the recording cannot distinguish it from the function
    explained: float = 1.0  # share of the excess misfit that the function removes
    # other names that are confounded with it, nearest first
    rivals: tuple[str, ...] = ()
    siblings: tuple[str, ...] = ()  # nearest effects of the catalogue, nearest first
    contest: Contest | None = None  # names that were tried in its place
    # Others at the same point of the chain are multiplied by one plus this function.
    multiplies: bool = False
    lag_s: float | None = None  # time constant of an argument that lags
    # Functions of another state that multiply this one: both together are one of two states.
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


@dataclass(frozen=True, kw_only=True)
class Explanation:
    """All that the engine concludes from one recording."""

    # Without the audit's findings: a caller that found a fault of the recording overrides it.
    verdict: Verdict
    # What was left out, most certain first; empty if nothing was.
    effects: tuple[NamedEffect, ...] = ()
    # Nominal parameters of the final fit, by joint and parameter.
    parameters: Mapping[str, Mapping[str, NominalEstimate]] = field(default_factory=dict)
    nominal: PlantDescription  # as given
    refitted: PlantDescription  # with its parameters refitted
    augmented: PlantDescription  # with the named effects
    # By 'nominal', 'refitted', 'augmented' and signal, written `wires/measured_js:wire_x_pos`.
    # Empty where nothing may be fitted, or nothing can be.
    fit: Mapping[str, Mapping[str, ChannelFit]] = field(default_factory=dict)
    candidates: tuple[Tried, ...] = ()  # candidates that were refitted, best first
    unknown: UnknownTerm | None = None  # the missing term for `unknown_physics`
    # Joint and place of functions of the augmented plant that are no finding: they repair what
    # another form of the plant would leave.
    repairs_form: tuple[tuple[str, str], ...] = ()
    adequate: bool = True  # the augmented plant leaves nothing but noise and small errors of form
    # What it leaves over what rigs of another form leave, of the worst joint.
    beyond_form: float = math.nan
    # how the final fits ended, by joint
    fitting: Mapping[str, Fitting] = field(default_factory=dict)
    # By joint, what was tried where nothing, or nothing more, is found to be missing.
    contests: Mapping[str, Contest] = field(default_factory=dict)

    def left_open(self, joint: str) -> Posterior:
        """What may be missing from a joint besides what is named; empty where noise is left."""
        contest = self.contests.get(joint)
        return {} if contest is None else contest.left_open(contest.nameless)

    def instead(self, joint: str) -> tuple[str, ...]:
        """Names of it, the likeliest first."""
        contest = self.contests.get(joint)
        return () if contest is None else contest.alternatives(OTHER_NUMBERS)

    @staticmethod
    def without_fit(verdict: Verdict, plant: PlantDescription) -> 'Explanation':
        """The answer where nothing may be fitted, or nothing can be."""
        return Explanation(verdict=verdict, nominal=plant, refitted=plant, augmented=plant)
