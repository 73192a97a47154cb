"""One physics for all recordings: found on five tubes, carried to other states of the rig."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from endoscope_core.physics.effects import CATALOGUE, KNOWN
from endoscope_explain.decide.decision import decide
from endoscope_explain.explanation import NINETY_PERCENT
from endoscope_explain.fit.evidence import log_evidence
from endoscope_explain.fit.intervals import FORMS, with_form
from endoscope_explain.fit.model import Fit, JointModel, jacobian, without_effect
from endoscope_explain.fit.pooled import deviations, fit_together, judged_alone
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.search.levels import Level, search
from endoscope_lab.identification.family_fit import FITTED_CYCLES
from endoscope_lab.real.rig import Plant, Told, as_described, best_refitted, wide
from endoscope_lab.real.takes import OTHERS, STATE, TIGHTENED, TUBES, UNKNOWN_TUBES, read

Array = NDArray[np.float64]
Tell = Callable[[str], None]

MOST_EFFECTS = 3
ROUNDS = 4
"""Pooled fits, each begun where the one before ended."""


Number = tuple[float, float, float]
"""A fitted number, and the ends of its 90 % interval."""


@dataclass(frozen=True)
class Tubes:
    """The five tubes."""

    told: tuple[Told, ...]  # judged on what was not fitted
    # Missing from all of them together; where none can be named, the best one.
    effects: tuple[str, ...]
    named: bool  # the effects are named
    search: tuple[str, ...]  # what it said
    levels: tuple[Level, ...]  # what it tried
    wide: tuple[Fit, ...]
    explained: tuple[Fit, ...]


def explained_tubes(folder: Path, jobs: int, tell: Tell) -> Tubes:
    """Fit all tubes together on their first 1.3 cycles, and search what they lack."""
    takes = [read(folder / f'{name}.txt') for name in TUBES]
    fitted_s = [FITTED_CYCLES * take.cycle_s for take in takes]
    parts = [take.until(end).observation() for take, end in zip(takes, fitted_s, strict=True)]
    fits, described = fitted_as_one(parts)
    models = [each.model for each in described]
    starts = [each.theta for each in described]
    said: list[str] = []

    def heard(text: str) -> None:
        said.append(text)
        tell(text)

    tried = search(list(zip(fits, described, strict=True)), jobs, MOST_EFFECTS, report=heard)
    named = bool(tried.found.effects) or not tried.levels
    chosen = tried.found if named else tried.levels[-1].best
    explained = chosen.fits
    told = []
    for take, end, model, start, before, after in zip(
        takes, fitted_s, models, starts, fits, explained, strict=True
    ):
        whole = take.observation()
        plants = {
            'nominal': Plant(model, start).on(whole),
            'refitted': Plant.of(before).on(whole),
            'augmented': Plant.of(after).on(whole),
        }
        told.append(Told(take, end, plants))
    search_said = tuple(text for text in said if 'nats' in text)
    return Tubes(
        tuple(told),
        chosen.effects,
        named,
        search_said,
        tried.levels,
        tuple(fits),
        tuple(explained),
    )


def fitted_as_one(observations: Sequence[JointObservation]) -> tuple[list[Fit], list[Fit]]:
    """Recordings of all tubes fitted as one instrument, and as described."""
    models = [wide(each) for each in observations]
    starts = [as_described(model) for model in models]
    fits = fit_together(models, starts)
    for _ in range(ROUNDS - 1):
        fits = fit_together(models, [f.theta for f in fits])
    return fits, [as_fit(m, s) for m, s in zip(models, starts, strict=True)]


def as_fit(model: JointModel, theta: Array) -> Fit:
    residuals = model.residuals(theta)
    return Fit(model, theta, residuals, jacobian(model, theta), model.cost(residuals, theta))


def numbers(fits: Sequence[Fit], jobs: int) -> dict[str, list[Number | None]]:
    """Numbers of several recordings by name; None where one lacks the effect."""
    owners = {p: f'{e.id}.' for e in CATALOGUE.values() for p in e.places}
    found: dict[str, list[Number | None]] = {}
    for n, (one, deviation) in enumerate(zip(fits, deviations(fits), strict=True)):
        form = with_form(one, jobs).moved_by_form
        reach = NINETY_PERCENT * deviation
        if form is not None:
            reach = np.hypot(reach, student.ppf(0.95, FORMS) * np.sqrt(np.diag(form)))
        for item, theta, far in zip(one.model.free, one.theta, reach, strict=True):
            name = owners.get(item.index, '') + item.name
            middle, low, high = (item.value(float(theta + side * far)) for side in (0, -1, 1))
            found.setdefault(name, [None] * len(fits))[n] = (middle, low, high)
    return found


@dataclass(frozen=True)
class State:
    """The rig in another state."""

    told: tuple[Told, ...]  # the recording that was fitted, then those that are predicted from it
    fit: Fit  # with the tubes' effects
    # Logarithm of the evidence that is lost without each of the tubes' effects.
    needed: Mapping[str, float]
    alone: tuple[str, ...]  # what would be named by this recording alone


def explained_state(folder: Path, tubes: Tubes, jobs: int, tell: Tell) -> State:
    """Explain a recording of the rig in another state by the tubes' effects, predict the others."""
    take = read(folder / f'{STATE}.txt')
    observation = take.observation()
    tell(f'{take.name}: refitting the nominal plant')

    def begun(found: Fit) -> Plant:
        return Plant.of(found).on(observation).with_cell_of_unknown_unit()

    # The instrument is the tubes'.
    before = best_refitted([begun(f) for f in judged_alone(tubes.wide)])
    tell(f"{take.name}: explaining it by the tubes' effects")
    explained = judged_alone(tubes.explained)
    known = [f for f in explained if _has_all(f, tubes.effects)] or explained
    after = best_refitted([begun(f) for f in known])
    needed = {}
    for effect in tubes.effects:
        if after.model.flags[KNOWN[effect].flag]:
            lesser = Plant(*without_effect(after, effect)).refitted()
            needed[effect] = log_evidence(after) - log_evidence(lesser)
    told = [Told(take, 0.0, _plants(before, after, observation))]
    for name in (*OTHERS, TIGHTENED):
        other = read(folder / f'{name}.txt')
        seen = other.observation()
        plants = _plants(before, after, seen)
        if name == TIGHTENED:
            for key in ('refitted', 'augmented'):
                plants[key] = Plant.of(plants[key].held(('pretension',), seen).refitted())
        told.append(Told(other, 0.0, plants))
    tell(f'{take.name}: what it would be given alone')
    cycle = Plant.of(before).on(take.until(take.cycle_s).observation()).refitted()
    decision = decide(search([(cycle,)], jobs, MOST_EFFECTS), jobs)
    alone = tuple(term.name for term in decision.missing)
    return State(tuple(told), after, needed, alone)


def _has_all(found: Fit, effects: Sequence[str]) -> bool:
    return all(found.model.flags[KNOWN[e].flag] for e in effects)


def _plants(before: Fit, after: Fit, seen: JointObservation) -> dict[str, Plant]:
    model = wide(seen)
    return {
        'nominal': Plant(model, as_described(model)),
        'refitted': Plant.of(before).on(seen),
        'augmented': Plant.of(after).on(seen),
    }


def unknown_tubes(folder: Path, tubes: Tubes, tell: Tell) -> list[Told]:
    """Recordings of tubes that nobody described.

    The instrument is that of the five tubes; a tube's own numbers are refitted, and what scatters
    from tube to tube, drawn to their mean.
    """
    # Every tube is tried as a start; 1.3 cycles are fitted, the others are judged.
    found = []
    for name in UNKNOWN_TUBES:
        tell(f'{name}: refitting the tube')
        take = read(folder / f'{name}.txt')
        begin = FITTED_CYCLES * take.cycle_s
        part, whole = take.until(begin).observation(), take.observation()
        model = wide(whole)
        plants = {'nominal': Plant(model, as_described(model))}
        for key, fits in (('refitted', tubes.wide), ('augmented', tubes.explained)):
            starts = [Plant.of(f).on(part) for f in judged_alone(fits)]
            plants[key] = Plant.of(best_refitted(starts)).on(whole)
        found.append(Told(take, begin, plants))
    return found
