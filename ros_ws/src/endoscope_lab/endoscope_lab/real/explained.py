"""One plant for all recordings: found on five tubes, applied to other states of the rig."""

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
from endoscope_lab.real.rig import JudgedTake, Plant, as_described, best_refitted, wide
from endoscope_lab.real.takes import OTHERS, STATE, TIGHTENED, TUBES, UNKNOWN_TUBES, read

Array = NDArray[np.float64]
Report = Callable[[str], None]

MOST_OF_TUBES = 3
ROUNDS = 4
"""Pooled fits, each started from the result of the last."""


Number = tuple[float, float, float]
"""A fitted number, and the ends of its 90 % interval."""


@dataclass(frozen=True)
class ExplainedTubes:
    """The five tubes."""

    takes: tuple[JudgedTake, ...]  # judged on samples that were not fitted
    # Missing from all of them together; if none can be named, the best candidate.
    effects: tuple[str, ...]
    named: bool  # whether the effects are named
    search: tuple[str, ...]  # its log
    levels: tuple[Level, ...]  # of the search
    wide: tuple[Fit, ...]
    explained: tuple[Fit, ...]


def explained_tubes(folder: Path, jobs: int, report: Report) -> ExplainedTubes:
    """Fit all tubes together on their first 1.3 cycles, and search for missing physics."""
    takes = [read(folder / f'{name}.txt') for name in TUBES]
    fitted_s = [FITTED_CYCLES * take.cycle_s for take in takes]
    parts = [take.until(end).observation() for take, end in zip(takes, fitted_s, strict=True)]
    fits, described = fitted_as_one(parts)
    models = [each.model for each in described]
    starts = [each.theta for each in described]
    log: list[str] = []

    def logged(text: str) -> None:
        log.append(text)
        report(text)

    tried = search(list(zip(fits, described, strict=True)), jobs, MOST_OF_TUBES, report=logged)
    named = bool(tried.found.effects) or not tried.levels
    chosen = tried.found if named else tried.levels[-1].best
    explained = chosen.fits
    judged = []
    for take, end, model, start, before, after in zip(
        takes, fitted_s, models, starts, fits, explained, strict=True
    ):
        whole = take.observation()
        plants = {
            'nominal': Plant(model, start).on(whole),
            'refitted': Plant.of(before).on(whole),
            'augmented': Plant.of(after).on(whole),
        }
        judged.append(JudgedTake(take, end, plants))
    return ExplainedTubes(
        tuple(judged),
        chosen.effects,
        named,
        tuple(text for text in log if 'nats' in text),
        tried.levels,
        tuple(fits),
        tuple(explained),
    )


def fitted_as_one(observations: Sequence[JointObservation]) -> tuple[list[Fit], list[Fit]]:
    """Fits of all tubes as one instrument, and the tubes as described."""
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
    """Parameters of several recordings by name; None where a recording lacks the effect."""
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
class OtherState:
    """The rig in another state."""

    takes: tuple[JudgedTake, ...]  # the recording that was fitted, then those predicted from it
    fit: Fit  # with the tubes' effects
    # Loss of log evidence without each of the tubes' effects.
    needed: Mapping[str, float]
    alone: tuple[str, ...]  # names given by this recording alone


def explained_state(folder: Path, tubes: ExplainedTubes, jobs: int, report: Report) -> OtherState:
    """Explain a recording of the rig in another state by the tubes' effects, predict the others."""
    take = read(folder / f'{STATE}.txt')
    observation = take.observation()
    report(f'{take.name}: refitting the nominal plant')

    def begun(found: Fit) -> Plant:
        return Plant.of(found).on(observation).with_cell_of_unknown_unit()

    # The instrument is the tubes'.
    before = best_refitted([begun(f) for f in judged_alone(tubes.wide)])
    report(f"{take.name}: explaining it by the tubes' effects")
    explained = judged_alone(tubes.explained)
    known = [f for f in explained if _has_all(f, tubes.effects)] or explained
    after = best_refitted([begun(f) for f in known])
    needed = {}
    for effect in tubes.effects:
        if after.model.flags[KNOWN[effect].flag]:
            lesser = Plant(*without_effect(after, effect)).refitted()
            needed[effect] = log_evidence(after) - log_evidence(lesser)
    judged = [JudgedTake(take, 0.0, _plants(before, after, observation))]
    for name in (*OTHERS, TIGHTENED):
        other = read(folder / f'{name}.txt')
        seen = other.observation()
        plants = _plants(before, after, seen)
        if name == TIGHTENED:
            for key in ('refitted', 'augmented'):
                plants[key] = Plant.of(plants[key].held(('pretension',), seen).refitted())
        judged.append(JudgedTake(other, 0.0, plants))
    report(f'{take.name}: explaining it alone')
    cycle = Plant.of(before).on(take.until(take.cycle_s).observation()).refitted()
    decision = decide(search([(cycle,)], jobs, MOST_OF_TUBES), jobs)
    alone = tuple(term.name for term in decision.missing)
    return OtherState(tuple(judged), after, needed, alone)


def _has_all(found: Fit, effects: Sequence[str]) -> bool:
    return all(found.model.flags[KNOWN[e].flag] for e in effects)


def _plants(before: Fit, after: Fit, seen: JointObservation) -> dict[str, Plant]:
    model = wide(seen)
    return {
        'nominal': Plant(model, as_described(model)),
        'refitted': Plant.of(before).on(seen),
        'augmented': Plant.of(after).on(seen),
    }


def unknown_tubes(folder: Path, tubes: ExplainedTubes, report: Report) -> list[JudgedTake]:
    """Recordings in tubes without a description.

    The instrument is that of the five tubes. The tube's own parameters are refitted, and those that
    scatter from tube to tube are shrunk to their mean.
    """
    # Every known tube is tried as a start; 1.3 cycles are fitted, the rest is judged.
    found = []
    for name in UNKNOWN_TUBES:
        report(f'{name}: refitting the tube')
        take = read(folder / f'{name}.txt')
        begin = FITTED_CYCLES * take.cycle_s
        part, whole = take.until(begin).observation(), take.observation()
        model = wide(whole)
        plants = {'nominal': Plant(model, as_described(model))}
        for key, fits in (('refitted', tubes.wide), ('augmented', tubes.explained)):
            starts = [Plant.of(f).on(part) for f in judged_alone(fits)]
            plants[key] = Plant.of(best_refitted(starts)).on(whole)
        found.append(JudgedTake(take, begin, plants))
    return found
