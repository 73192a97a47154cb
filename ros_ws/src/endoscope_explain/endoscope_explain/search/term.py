"""What may be missing from a joint: an effect of the literature, or a function at a place."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.effect import Effect, NominalPhysics
from endoscope_core.physics.effects import CATALOGUE, KNOWN
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.evaluation import ADDS, FLAGS_OF_FUNCTIONS, MULTIPLIES
from endoscope_core.physics.functions.places import HIGH, LAG, LAGS_S, LOW, Place, Shape
from endoscope_explain.fit.family import Family, family_at, visited_range, visited_states
from endoscope_explain.fit.free_parameters import (
    coefficients,
    effect_parameters,
    time_scale,
    with_free_reference,
)
from endoscope_explain.fit.model import Fit, JointModel, simulate_joint
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.observe.revisits import motion_repeats
from endoscope_explain.recording import Array
from endoscope_explain.search.periods import likely_periods, period_bounds

Variant = tuple[str, tuple[float, ...]]
"""A term, and what it acts on or which of its forms it has, which no shape of a tube changes."""

Known = Mapping[str, Mapping[str, float]]
"""Effects and places that other recordings of a rig gave or left open, each with the numbers that
it had; none where only its name is known."""

LAGS = 3
"""Time constants at which arguments that lag are tried."""


@dataclass(frozen=True)
class Term:
    """One term more."""

    effect: Effect  # of the catalogue, or the place of a function
    # Parameters of an effect at which its fit begins.
    start: Mapping[str, float] = field(default_factory=dict)
    family: Family | None = None  # of the function

    @property
    def id(self) -> str:
        """Of the effect or place."""
        return self.effect.id

    @property
    def variant(self) -> Variant:
        """Its id, and what it acts on or which of its forms it has."""
        if self.multiplies:
            return self.id, (float(MULTIPLIES),)
        choices = [p.name for p in self.effect.parameters if p.choices and p.name in self.start]
        return self.id, tuple(self.start[name] for name in choices)

    @property
    def is_function(self) -> bool:
        """Whether it is a function of no known form."""
        return self.family is not None

    @property
    def is_nominal(self) -> bool:
        """Whether it is a piece of the nominal physics."""
        return isinstance(self.effect, NominalPhysics)

    @property
    def is_in_every_rig(self) -> bool:
        """Whether that a rig has none of it is no hypothesis."""
        return isinstance(self.effect, NominalPhysics) and self.effect.in_every_rig

    @property
    def multiplies(self) -> bool:
        """Whether it makes another function one of two states."""
        return self.family is not None and self.family.multiplies

    @property
    def places(self) -> tuple[str, ...]:
        """Places whose functions it is one of."""
        if self.multiplies:
            return ()
        return (self.effect.id,) if self.is_function else self.effect.traits.families

    @property
    def is_linear(self) -> bool:
        """Whether a multiple of it does a multiple of what it does."""
        return self.is_function or not any(p.scale for p in self.effect.parameters)

    def shares_place(self, other: 'Term') -> bool:
        """Whether both are functions of the same state at the same place."""
        return bool(set(self.places) & set(other.places))

    def added_to(self, model: JointModel) -> JointModel:
        """The model with this term, free."""
        if self.family is not None:
            return _with_function(model, self.family)
        return with_effect(model, self.effect, self.start)


def with_effect(model: JointModel, effect: Effect, start: Mapping[str, float]) -> JointModel:
    """The model with one more effect, its parameters at `start` and free."""
    _require_absent(model, effect)
    base, flags = model.base.copy(), model.flags.copy()
    flags[effect.flag] = True
    for place, parameter in zip(effect.places, effect.parameters, strict=True):
        value = start.get(parameter.name, parameter.typical)
        base[place] = model.observation.duration if parameter.is_duration else value
    free = with_free_reference(model.free, effect.id) + effect_parameters(effect.id)
    return replace(model, base=base, flags=flags, free=free)


def _with_function(model: JointModel, family: Family) -> JointModel:
    _require_absent(model, family.place)
    place, base = family.place, model.base.copy()
    base[place.first_parameter + LOW] = family.low
    base[place.first_parameter + HIGH] = family.high
    if family.lag is not None:
        base[place.first_parameter + LAG] = family.lag
    flags: NDArray[Any] = model.flags.astype(FLAGS_OF_FUNCTIONS)
    flags[place.flag] = MULTIPLIES if family.multiplies else ADDS
    free = model.free + coefficients(place.id, family.basis.shape[1])
    if family.band is not None:
        free += (time_scale(place, *family.band),)
    return replace(model, base=base, flags=flags, free=free, families=(*model.families, family))


def _require_absent(model: JointModel, term: Effect) -> None:
    """Refuse a term that is there: a joint holds each once."""
    if model.flags[term.flag]:
        raise ValueError(f'{term.id} is there already on {model.observation.joint}')


def effects(found: Fit, left_out: tuple[str, ...] = ()) -> tuple[Term, ...]:
    """Effects, and nominal physics that is lacking, that may be added to a fit, at their starts."""
    return tuple(
        Term(effect, start)
        for effect in _absent(found, KNOWN.values())
        if not effect.traits.audited and effect.id not in left_out
        for start in starting_points(effect)
    )


def functions(found: Fit, residuals: Array) -> tuple[Term, ...]:
    """Functions that may be added to a fit, as tall as their place allows at most."""
    # One for each place whose argument has moved; one for each likely period where functions repeat
    # themselves, and for some lags where their argument lags; one more that multiplies those that
    # are there. Without those of time where the joint makes no motion twice.
    states, observation = states_of(found), found.model.observation
    there = {family.place.point for family in found.model.families}
    candidates = []
    for place in _absent(found, FUNCTIONS.values()):
        state = states[place.argument.symbol, place.argument.unit]
        if place.shape is Shape.PERIODIC:
            band = period_bounds(observation, state)
            likely = likely_periods(observation, residuals, state)
            families = [family_at(place, (0.0, each), band=band) for each in likely]
        elif place.argument.lags:
            families = [_lagging(place, states, observation, lag) for lag in _lags(observation)]
        else:
            families = [family_at(place, visited_range(place, states, observation.tick))]
        alone = [family for family in families if family is not None]
        candidates += [Term(place, family=family) for family in alone]
        if place.point in there:
            both = (replace(family, multiplies=True) for family in alone)
            candidates += [Term(place, family=family) for family in both]
    return tuple(candidates)


def _lags(observation: JointObservation) -> Array:
    """Time constants to begin at, evenly in their logarithm."""
    # They are longer than ten ticks of the slowest sensor, and shorter than a third of the
    # recording: what is quicker is the state itself, and what is slower a function of time.
    slowest = min(len(channel.time) for channel in observation.channels)
    low = max(LAGS_S[0], 10.0 * observation.duration / slowest)
    return np.geomspace(low, max(low, observation.duration / 3.0), LAGS + 2)[1:-1]


def _lagging(
    place: Place,
    states: dict[tuple[str, str], Array],
    observation: JointObservation,
    lag: float,
) -> Family | None:
    visited = visited_range(place, states, observation.tick, lag)
    found = family_at(place, visited, band=LAGS_S)
    return found and replace(found, lag=float(lag))


def _absent[E: Effect](found: Fit, terms: Iterable[E]) -> Iterator[E]:
    """Terms that are not there yet, as themselves or as part of a function or of its formula."""
    flags, repeats = found.model.flags, motion_repeats(found.model.observation)
    there = {place.id for place in FUNCTIONS.values() if flags[place.flag]}
    formulas = {p for e in CATALOGUE.values() if flags[e.flag] for p in e.traits.families}
    for term in terms:
        present = flags[term.flag] or term.id in formulas or there & {*term.traits.families}
        if isinstance(term, NominalPhysics):
            present = present or not term.is_lacking(found.model.base)
        if not present and (repeats or not term.traits.depends_on_time):
            yield term


def starting_points(effect: Effect) -> list[dict[str, float]]:
    """Combinations of an effect's starting values and discrete choices, each once."""
    values = [
        tuple(dict.fromkeys(p.choices or p.starts or (p.typical,))) for p in effect.parameters
    ]
    names = [p.name for p in effect.parameters]
    return [dict(zip(names, combination, strict=True)) for combination in product(*values)]


def begun_as_before(terms: Iterable[Term], known: Known) -> Iterator[Term]:
    """Effects that are known, each begun at the numbers that it had."""
    first = {term.id: term for term in reversed(tuple(terms)) if not term.is_function}
    for name, numbers in known.items():
        if numbers and name in first:
            yield replace(first[name], start={**first[name].start, **numbers})


def mirrored(term: Term) -> Term | None:
    """The effect on the other side of no effect at all; None where there is none."""
    start, changed = dict(term.start), False
    for parameter in term.effect.parameters:
        value = start[parameter.name]
        if parameter.phase:
            start[parameter.name], changed = value - math.copysign(math.pi, value), True
            continue
        other = 2.0 * parameter.off - value
        if parameter.low < parameter.off and parameter.low <= other <= parameter.high:
            start[parameter.name] = other
            changed = changed or other != value
    return replace(term, start=start) if changed else None


def states_of(found: Fit) -> dict[tuple[str, str], Array]:
    """States that a function may depend on, along a fit; see `visited_states`."""
    parameters, _ = found.model.packed(found.theta)
    outputs = simulate_joint(found.model.observation, parameters, found.model.flags)
    return visited_states(found.model.observation, parameters, outputs)
