"""What an answer leaves open, and each law that it may be, fitted to the recordings."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.effects import KNOWN, describe
from endoscope_core.physics.layout import OUT_JOINT
from endoscope_core.physics.packing import without_functions
from endoscope_explain.case import ExplainedCase
from endoscope_explain.decide.conclusions import spec_of
from endoscope_explain.explanation import NamedEffect
from endoscope_explain.fit.free_parameters import (
    LEAD,
    FreeParameter,
    effect_parameters,
    nominal_parameters,
)
from endoscope_explain.fit.model import (
    Array,
    Fit,
    JointModel,
    fit,
    joint_of,
    packed_joint,
    simulate_joint,
)
from endoscope_explain.fit.nominal import with_any_numbers
from endoscope_explain.observe.observation import JointObservation, observe, with_held_noise
from endoscope_explain.options import BAND
from endoscope_explain.prediction_set import NOTHING, OTHER_NUMBERS, SOMETHING_ELSE, Contest
from endoscope_explain.recording import Mask, RigRecording
from endoscope_explain.search.screen import background, directions, screened
from endoscope_explain.search.term import Term, starting_points

DECIDED = math.log(99.0)
"""Logarithm of the odds at which more evidence decides nothing more."""
MOST_LAWS = 3
"""Of a question that are fitted: the likeliest."""
_LEAST = 1e-9
"""Probability below which one does not matter."""


@dataclass(frozen=True)
class OpenQuestion:
    """What a joint may lack, by its names."""

    joint: str
    # Probability of each law that is left open, of the one that was named first; none is 0.
    chances: Mapping[str, float]
    contest: Contest
    duration: float  # of the recordings, s
    effect: NamedEffect | None = None  # that was named; None where none was

    def temperature(self, duration: float) -> float:
        """By how much evidence is divided once a motion of `duration` s is made."""
        return self.contest.temperature(1.0 + duration / self.duration)

    def brings(
        self, apart: Mapping[tuple[str, str], float], duration: float
    ) -> tuple[float, float]:
        """Evidence in nats, as it is read, expected of a motion of `duration` s, and per second."""
        # `apart` is the evidence in nats of a law that is true over another one. Per second counts
        # what of it brings the true one no further than `DECIDED`.
        temperature = self.temperature(duration)
        whole = useful = 0.0
        total = sum(self.chances.values())
        for true, p in self.chances.items():
            for other, q in self.chances.items():
                if other == true:
                    continue
                weight = p * q / (total * (total - p))
                nats = apart.get((true, other), 0.0) / temperature
                whole += weight * nats
                useful += weight * min(nats, max(0.0, DECIDED - math.log(p / q)))
        return whole, useful / duration


def open_questions(case: ExplainedCase) -> list[OpenQuestion]:
    """What is left open beside each effect of a case, and at joints where none, or no more, is."""
    explanation, found = case.explanation, []
    duration = case.recording.duration
    contests: list[tuple[str, Contest | None, NamedEffect | None]] = [
        *((effect.joint, effect.contest, effect) for effect in case.effects),
        *((joint, contest, None) for joint, contest in explanation.contests.items()),
    ]
    for joint, contest, effect in contests:
        if contest is None:
            continue
        named = contest.nameless if effect is None else effect.id
        for chances in (_statements(contest, named), _names_of_one(contest, named)):
            found.append(OpenQuestion(joint, chances, contest, duration, effect))
    return [each for each in found if len(each.chances) > 1]


def _statements(contest: Contest, named: str) -> dict[str, float]:
    """The set that is left open, each statement by the first of its names that can be simulated."""
    chances: dict[str, float] = {}
    for names, p in contest.left_open(named).items():
        name = named if named in names else next((n for n in names if n in KNOWN), names[0])
        chances[name] = chances.get(name, 0.0) + max(p, _LEAST)
    return dict(sorted(chances.items(), key=lambda each: each[0] != named))


def _names_of_one(contest: Contest, named: str) -> dict[str, float]:
    """Names that are one statement with what was named so far, and that can be simulated."""
    # Another motion may tell them apart. Until then none is likelier than another.
    own = next((names for names in contest.left_open(named) if named in names), ())
    laws = [named, *(n for n in own if n != named and (n in KNOWN or n == OTHER_NUMBERS))]
    return dict.fromkeys(laws, 1.0 / len(laws))


def fitted_laws(case: ExplainedCase, question: OpenQuestion) -> dict[str, PlantDescription]:
    """A plant of each law that can be simulated, fitted to the recordings, by its name."""
    # Without what was named there is nothing to compare: empty where the improved plant lacks it.
    plant = case.explanation.augmented
    named, joint = next(iter(question.chances)), question.joint
    there = {spec.id for spec in plant.effects if spec.joint == joint}
    if question.effect is not None and named not in there:
        return {}
    laws = {named: plant}
    others = [n for n in question.chances if n not in {named, SOMETHING_ELSE, *there}]
    if not others:
        return laws
    if question.effect is not None:
        bare = without(plant, question.effect)
    else:
        described = case.explanation.nominal.joints[joint]
        bare = replace(plant, joints={**plant.joints, joint: described})
    observation = observed(case.recording, bare, joint)
    for name in others:
        if len(laws) == MOST_LAWS:
            break
        law = _law(bare, observation, name, case.inputs.sources.band)
        if law is not None:
            laws[name] = law
    return laws


def _law(
    bare: PlantDescription, observation: JointObservation, name: str, band: float
) -> PlantDescription | None:
    """A plant without what was named that has another law; None where it cannot have it."""
    if name in KNOWN:
        return with_effect(bare, observation, name, band)
    if name not in (NOTHING, OTHER_NUMBERS):
        return None
    fitted = refit(bare, observation, 6, band)
    fitted = fitted if name == NOTHING else with_any_numbers(fitted)
    return with_fit(bare, observation.joint, fitted)


def observed(recording: RigRecording, plant: PlantDescription, joint: str) -> JointObservation:
    """What one joint reads, beside the angle that the plant gives the other one."""
    seen = {each.joint: each for each in with_held_noise(observe(recording, plant))}
    own = seen.pop(joint)
    for other in seen.values():
        own = own.beside(simulate_joint(other, *packed_joint(plant, other.joint))[:, OUT_JOINT])
    return own


def free_numbers(
    plant: PlantDescription, joint: str, band: float = BAND
) -> tuple[Array, Mask, tuple[FreeParameter, ...]]:
    """Packed parameters and flags of a joint of a plant, and what is free: its effects', too."""
    base, flags = packed_joint(plant, joint)
    free = nominal_parameters(base, band)
    for spec in plant.effects:
        if spec.joint == joint:
            free += effect_parameters(spec.id)
    return base, flags, free


def coordinates(base: Array, free: Sequence[FreeParameter]) -> Array:
    """Coordinates (n,) of free numbers where the packed ones are."""
    return np.array([i.coordinate(1.0 if i.index == LEAD else float(base[i.index])) for i in free])


def without(plant: PlantDescription, effect: NamedEffect) -> PlantDescription:
    """The plant without an effect, and without functions that are part of it."""
    others = tuple(e for e in plant.effects if (e.id, e.joint) != (effect.id, effect.joint))
    places = (effect.id, *effect.definition.traits.families)
    return without_functions(replace(plant, effects=others), effect.joint, places)


def refit(
    plant: PlantDescription, observation: JointObservation, iterations: int, band: float
) -> Fit:
    """Refit one joint of a plant, its effects included, from where it is."""
    base, flags, free = free_numbers(plant, observation.joint, band)
    model = JointModel(observation, base, flags, free)
    return fit(model, coordinates(base, free), iterations=iterations)


def with_fit(plant: PlantDescription, joint: str, found: Fit) -> PlantDescription:
    """Put the fitted numbers of one joint back into a plant."""
    packed, _ = found.model.packed(found.theta)
    effects = tuple(
        spec_of(describe(spec.id), joint, packed) if spec.joint == joint else spec
        for spec in plant.effects
    )
    return replace(plant, joints={**plant.joints, joint: joint_of(packed)}, effects=effects)


def with_effect(
    bare: PlantDescription, observation: JointObservation, name: str, band: float
) -> PlantDescription | None:
    """Fit an effect that a plant has not to one joint; None where nothing of it shows."""
    behind = background(refit(bare, observation, 2, band))
    terms = tuple(Term(describe(name), start) for start in starting_points(describe(name)))
    ways = directions(behind, terms, 1)
    if not ways:
        return None
    # Beside numbers that are bent by what was taken out, a law may gain nothing at its starts.
    ranked = screened(behind, ways) or [ways[0].term]
    packed, joint = ranked[0].added_to(behind.fit.model).base, observation.joint
    term = replace(bare, effects=(*bare.effects, spec_of(describe(name), joint, packed)))
    return with_fit(term, joint, refit(term, observation, 6, band))
