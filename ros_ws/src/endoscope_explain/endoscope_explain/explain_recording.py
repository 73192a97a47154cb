"""From a cleaned recording and a plant description to named effects."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import OTHER_ANGLE
from endoscope_core.physics.layout import IN_OTHER_JOINT
from endoscope_core.workers import parallel_map
from endoscope_explain.decide.conclusions import (
    candidates,
    fitting,
    is_unknown,
    ladder,
    missing_function,
    named,
    numbers_differ,
    plant_of,
    refitted,
    verdict,
)
from endoscope_explain.decide.decision import Decision, GivenJoints, decide, explained_by
from endoscope_explain.explanation import Explanation, Verdict
from endoscope_explain.fit.intervals import nominal_estimates
from endoscope_explain.fit.model import Fit, packed_joint
from endoscope_explain.fit.nominal import (
    ReferenceFits,
    against_baseline,
    all_references,
    beside,
    simulated_bending,
    with_references,
)
from endoscope_explain.observe.observation import JointObservation, observe, with_held_noise
from endoscope_explain.options import BAND, MOST_EFFECTS
from endoscope_explain.recording import LEAST_DURATION_S, MOVES_RAD, Array, RigRecording
from endoscope_explain.search.expansion import addable
from endoscope_explain.search.levels import JointSearch, Level, search
from endoscope_explain.search.null_rigs import NEAR
from endoscope_explain.search.refit import Candidate
from endoscope_explain.search.screen import background, directions, gains
from endoscope_explain.search.term import Known, Term

Progress = Callable[[str], None]

SAME_RIG = 0.03
"""Relative tolerance of a nominal parameter from one recording of a rig to the next."""
ROUNDS = 3
"""In which both joints are explained beside each other, if they still change: the second one sees
what the first one made of the other, and the third confirms that it stands."""

Explained = tuple[JointSearch, Decision]


def explain_recording(
    recording: RigRecording,
    plant: PlantDescription,
    *,
    baseline: RigRecording | None = None,
    band: float = BAND,
    most_effects: int = MOST_EFFECTS,
    given: GivenJoints | None = None,
    left_out: tuple[str, ...] = (),
    known: Mapping[str, Known] | None = None,
    jobs: int = 2,
    progress: Progress | None = None,
) -> Explanation:
    """Explain why a recording differs from the simulation of a plant."""
    # What is `known` of a joint from other recordings of the rig is fitted in any case.
    report = progress or (lambda _: None)
    observations = tuple(o for o in with_held_noise(observe(recording, plant)) if o.channels)
    if not _is_enough(observations):
        return Explanation.without_fit(Verdict.INSUFFICIENT_DATA, plant)
    report('refitting the nominal plant')
    well = plant
    if baseline is not None:
        report('searching what the baseline lacks')
        observations, well = _healthy(observations, baseline, plant, band, left_out, jobs)
        band = SAME_RIG
    observations, references = with_references(recording, observations, well, band, jobs)

    def explained(pair: ReferenceFits) -> Explained:
        joint = pair[0].model.observation.joint
        if given is not None:
            return explained_by(pair, given[joint], jobs)
        tried = search([pair], jobs, most_effects, left_out, (known or {}).get(joint))
        return tried, decide(tried, jobs)

    def stands(tried: JointSearch, angle: Array) -> bool:
        return given is None and stands_beside(tried, angle, left_out, jobs)

    searches, decisions = _explained_together(references, explained, stands, jobs, report)
    report('judging on what was held out')
    effects = named(observations, decisions)
    of_joint = {o.joint: d for o, d in zip(observations, decisions, strict=True)}
    return Explanation(
        verdict=verdict(
            [effect.stage for effect in effects],
            unknown=is_unknown(decisions),
            changed=numbers_differ(decisions),
        ),
        effects=effects,
        parameters={
            joint: nominal_estimates(d.chosen.fit, packed_joint(plant, joint)[0])
            for joint, d in of_joint.items()
        },
        nominal=plant,
        refitted=plant_of(well, list(map(refitted, searches, decisions))),
        augmented=plant_of(well, [d.chosen for d in decisions]),
        fit=ladder(references, searches, decisions),
        candidates=candidates(observations, searches),
        unknown=missing_function(decisions),
        repairs_form=tuple((joint, place) for joint, d in of_joint.items() for place in d.repairs),
        adequate=all(d.adequate for d in decisions),
        beyond_form=max(d.beyond_form for d in decisions),
        fitting={joint: fitting(d.chosen.fit) for joint, d in of_joint.items()},
        contests={
            joint: replace(d.open, beyond_form=d.beyond_form)
            for joint, d in of_joint.items()
            if d.open is not None
        },
    )


def _healthy(
    observations: tuple[JointObservation, ...],
    baseline: RigRecording,
    plant: PlantDescription,
    band: float,
    left_out: tuple[str, ...],
    jobs: int,
) -> tuple[tuple[JointObservation, ...], PlantDescription]:
    """Observations against a baseline, and the plant in health."""
    # A rig that never matched the plant is described by the term that comes nearest, right or not:
    # less is left that could hide what is new.
    before = with_held_noise(observe(baseline, plant))
    packed = {o.joint: packed_joint(plant, o.joint) for o in before}

    def described(references: tuple[Fit, Fit]) -> Candidate:
        tried = search([references], jobs, 1, left_out)
        found = [level.best for level in tried.levels if level.is_found]
        # What depends on time was the first recording's own.
        lasting = [c for c in found if not any(t.effect.traits.depends_on_time for t in c.terms)]
        return lasting[0] if lasting else tried.nominal

    healthy = [described(pair) for pair in all_references(before, packed, jobs, band)]
    by_joint = {c.fit.model.observation.joint: c for c in healthy}
    seen = tuple(against_baseline(o, by_joint[o.joint].fit) for o in observations)
    return seen, plant_of(plant, healthy)


def _explained_together(
    references: list[ReferenceFits],
    explained: Callable[[ReferenceFits], Explained],
    stands: Callable[[JointSearch, Array], bool],
    jobs: int,
    report: Progress,
) -> tuple[list[JointSearch], list[Decision]]:
    """Explain each joint beside the other as that is explained, until no tracker sees a change."""
    # Where the nominal plant leaves no more than noise, nothing that the other joint does is
    # missing.
    joints = ' and '.join(refitted.model.observation.joint for refitted, _ in references)
    report(f'searching what is missing from {joints}')
    found = parallel_map(explained, references, jobs)
    observations = [refitted.model.observation for refitted, _ in references]
    # How the other joint moved as each was explained: as in its nominal fit, at first.
    seen = [observation.inputs[0, :, IN_OTHER_JOINT] for observation in observations]
    for index in [0, 1] * ROUNDS if len(references) == 2 else []:
        (_, of_other), (_, own) = found[1 - index], found[index]
        angle = simulated_bending(of_other.chosen.fit)
        off = float(np.sqrt(np.mean((angle - seen[index]) ** 2)))
        if (not own.chosen.terms and own.adequate) or off <= _noise_of(observations[1 - index]):
            continue
        seen[index] = angle
        if stands(found[index][0], angle):
            continue
        joint = observations[index].joint
        report(f'searching what is missing from {joint} beside the other one as found')
        found[index] = explained(beside(references[index], of_other.chosen.fit))
    return [tried for tried, _ in found], [decision for _, decision in found]


def _noise_of(observation: JointObservation) -> float:
    """Noise (rms) in rad of a joint's bending angle; 0 where it was not recorded."""
    bending = [c.noise for c in observation.channels if c.quantity == 'bending']
    return float(np.sqrt(np.mean(bending[0] ** 2))) if bending else 0.0


def _is_enough(observations: tuple[JointObservation, ...]) -> bool:
    return any(
        o.duration >= LEAST_DURATION_S
        and np.ptp(o.inputs[0, :, 0]) >= MOVES_RAD
        and all(np.ptp(c.value) >= MOVES_RAD for c in o.channels if c.quantity == 'shaft_position')
        for o in observations
    )


_PLACES = frozenset(place.id for place in FUNCTIONS.values() if place.argument is OTHER_ANGLE)


def depends_on_other(term: Term) -> bool:
    """Whether a term depends on the other joint's angle."""
    return term.id in _PLACES or bool(_PLACES & set(term.effect.traits.families))


def stands_beside(tried: JointSearch, angle: Array, left_out: tuple[str, ...], jobs: int) -> bool:
    """Whether a search would find the same beside the other joint's angle (N,) in rad."""
    # Few terms depend on the other joint. Without one of them among what was found all else stands
    # as it is fitted, and only these are looked at again.
    found = [tried.found, *(level.best for level in tried.levels if level.found)]
    if any(depends_on_other(term) for one in found for term in one.terms):
        return False
    return all(_gain_beside(level, angle, left_out, jobs) < _least(level) for level in tried.levels)


def _least(level: Level) -> float:
    """Gain by the screen from which on a term might be found in place of the level's best."""
    # A fit may double what the screen shows of it.
    return NEAR * max(level.gain(level.best), 0.0) if level.found else 0.0


def _gain_beside(level: Level, angle: Array, left_out: tuple[str, ...], jobs: int) -> float:
    """Largest gain by the screen of what depends on the other joint."""
    parent = level.parent.fit
    observation = parent.model.observation.beside(angle)
    behind = background(replace(parent, model=replace(parent.model, observation=observation)))
    terms = [term for term in addable(behind, left_out) if depends_on_other(term)]
    ways = directions(behind, tuple(terms), jobs)
    residuals = behind.left(parent.residuals * behind.weight)[:, None]
    return float(np.max(gains(behind, ways, residuals).values, initial=0.0))
