"""What may be missing from a joint: an effect of the literature, or a function at a place."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

from numpy.typing import NDArray

from endoscope_core.physics.effect import Effect
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.acting import FLAGS_OF_FUNCTIONS
from endoscope_core.physics.functions.interpolation import HIGH, LOW
from endoscope_core.physics.functions.place import Shape
from endoscope_explain.fit.family import Family, family_at, visited_ranges
from endoscope_explain.fit.free_parameters import (
    coefficients,
    effect_parameters,
    with_free_reference,
)
from endoscope_explain.fit.model import Fit, JointModel
from endoscope_explain.fit.simulated_joint import simulate_joint
from endoscope_explain.search.repeated_motion import motion_repeats


@dataclass(frozen=True)
class Candidate:
    """One term more.

    Attributes
    ----------
    term : Effect
        Of the catalogue, or the place of a function.
    start : mapping of str to float
        Parameters of an effect at which its fit begins.
    family : Family or None
        Of the function.
    """

    term: Effect
    start: Mapping[str, float] = field(default_factory=dict)
    family: Family | None = None

    @property
    def id(self) -> str:
        """Of the effect or place."""
        return self.term.id

    @property
    def variant(self) -> tuple[str, tuple[float, ...]]:
        """Its id, and what it acts on or which of its forms it has."""
        choices = [p.name for p in self.term.parameters if p.choices and p.name in self.start]
        return self.id, tuple(self.start[name] for name in choices)

    @property
    def is_function(self) -> bool:
        """Whether it is a function of no known form."""
        return self.family is not None

    @property
    def places(self) -> tuple[str, ...]:
        """Places whose functions it is one of."""
        return (self.term.id,) if self.is_function else self.term.traits.families

    @property
    def is_linear(self) -> bool:
        """Whether a multiple of it does a multiple of what it does."""
        return self.is_function or not any(p.scale for p in self.term.parameters)

    def shares_place(self, other: 'Candidate') -> bool:
        """Whether both are functions of the same state at the same place."""
        return bool(set(self.places) & set(other.places))

    def added_to(self, model: JointModel) -> JointModel:
        """The model with this term, free."""
        if self.family is not None:
            return _with_function(model, self.family)
        return with_effect(model, self.term, self.start)


def with_effect(model: JointModel, effect: Effect, start: Mapping[str, float]) -> JointModel:
    """The model with one more effect, its parameters at `start` and free."""
    base, flags = model.base.copy(), model.flags.copy()
    flags[effect.flag] = True
    for place, parameter in zip(effect.places, effect.parameters, strict=True):
        value = start.get(parameter.name, parameter.typical)
        base[place] = model.observation.duration if parameter.is_duration else value
    free = with_free_reference(model.free, effect.id) + effect_parameters(effect.id)
    return replace(model, base=base, flags=flags, free=free)


def _with_function(model: JointModel, family: Family) -> JointModel:
    place, base = family.place, model.base.copy()
    base[place.first_parameter + LOW] = family.low
    base[place.first_parameter + HIGH] = family.high
    flags: NDArray[Any] = model.flags.astype(FLAGS_OF_FUNCTIONS)
    flags[place.flag] = True
    free = model.free + coefficients(place.id, family.basis.shape[1])
    return replace(model, base=base, flags=flags, free=free, families=(*model.families, family))


def candidates(found: Fit, left_out: tuple[str, ...] = ()) -> tuple[Candidate, ...]:
    """All terms that may be added to a fit, effects at each of their starting points.

    Parameters
    ----------
    found : Fit
    left_out : tuple of str
        Effects whose formulas are not tried.

    Returns
    -------
    tuple of Candidate
        Functions as tall as their place allows at most. Without terms that depend on time where the
        joint makes no motion twice.
    """
    repeats = motion_repeats(found.model.observation)

    flags = found.model.flags
    functions = {place.id for place in FUNCTIONS.values() if flags[place.flag]}
    formulas = {p for e in CATALOGUE.values() if flags[e.flag] for p in e.traits.families}

    def is_tried(term: Effect) -> bool:
        """Whether it is not there yet, as itself or as part of a function or of its formula."""
        present = flags[term.flag] or term.id in formulas or functions & {*term.traits.families}
        return not present and (repeats or not term.traits.depends_on_time)

    effects = [
        Candidate(effect, start)
        for effect in CATALOGUE.values()
        if is_tried(effect) and not effect.traits.audited and effect.id not in left_out
        for start in starting_points(effect)
    ]
    return (*effects, *(Candidate(f.place, family=f) for f in _families(found, is_tried)))


def starting_points(effect: Effect) -> list[dict[str, float]]:
    """Combinations of an effect's starting values and discrete choices, each once."""
    values = [
        tuple(dict.fromkeys(p.choices or p.starts or (p.typical,))) for p in effect.parameters
    ]
    names = [p.name for p in effect.parameters]
    return [dict(zip(names, combination, strict=True)) for combination in product(*values)]


def mirrored(candidate: Candidate) -> Candidate | None:
    """The effect on the other side of no effect at all; None where there is none."""
    start, changed = dict(candidate.start), False
    for parameter in candidate.term.parameters:
        value = start[parameter.name]
        if parameter.phase:
            start[parameter.name], changed = value - math.copysign(math.pi, value), True
            continue
        other = 2.0 * parameter.off - value
        if parameter.low < parameter.off and parameter.low <= other <= parameter.high:
            start[parameter.name] = other
            changed = changed or other != value
    return replace(candidate, start=start) if changed else None


def states_of(found: Fit) -> dict[tuple[str, str], tuple[float, float]]:
    """Range of each state that a function may depend on, along a fit; see `visited_ranges`."""
    parameters, _ = found.model.packed(found.theta)
    outputs = simulate_joint(found.model.observation, parameters, found.model.flags)
    return visited_ranges(found.model.observation, parameters, outputs)


def _families(found: Fit, is_tried: Any) -> Iterator[Family]:
    ranges = states_of(found)
    for place in FUNCTIONS.values():
        if place.shape is Shape.PERIODIC or not is_tried(place):
            continue
        family = family_at(place, ranges[place.argument.symbol, place.argument.unit])
        if family is not None:
            yield family
