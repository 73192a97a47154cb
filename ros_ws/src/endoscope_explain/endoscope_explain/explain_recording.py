"""From a cleaned recording and a plant description to named effects."""

import time
from collections.abc import Callable

import numpy as np

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.anchoring import all_anchors, anchored, simulated_bending
from endoscope_explain.baseline import against_baseline
from endoscope_explain.conclusions import (
    NOMINAL_UNITS,
    candidates,
    ladder,
    named,
    plant_of,
    refitted,
    verdict_of,
    with_term,
)
from endoscope_explain.decision import Decision, decide, with_devices_agreed
from endoscope_explain.explanation import Explanation, Verdict
from endoscope_explain.families.unknown_physics import unknown_physics
from endoscope_explain.fit.free_parameters import BAND
from endoscope_explain.fit.intervals import nominal_estimates
from endoscope_explain.fit.simulated_joint import packed_joint
from endoscope_explain.given_physics import GivenJoints, explained_by
from endoscope_explain.held_noise import with_held_noise
from endoscope_explain.observation import JointObservation, couple, observe
from endoscope_explain.recording import Recording
from endoscope_explain.search import MOST_EFFECTS, JointSearch, search

Progress = Callable[[str], None]

LEAST_DURATION_S = 2.0
LEAST_MOTION_RAD = 0.01
"""Of the shaft."""
SAME_RIG = 0.03
"""Relative tolerance of a nominal parameter from one recording of a rig to the next."""
SIBLINGS = 3


def explain_recording(
    recording: Recording,
    plant: PlantDescription,
    *,
    baseline: Recording | None = None,
    band: float = BAND,
    most_effects: int = MOST_EFFECTS,
    given: GivenJoints | None = None,
    left_out: tuple[str, ...] = (),
    jobs: int = 2,
    progress: Progress | None = None,
) -> Explanation:
    """Explain why a recording differs from the simulation of a plant.

    Parameters
    ----------
    recording : Recording
        As audited: increasing stamps, wrong samples marked invalid.
    plant : PlantDescription
        The simulation that the engineer has.
    baseline : Recording, optional
        Of the same rig when it was well; only what is new since is explained.
    band : float
        Relative tolerance by which a healthy rig's parameters may differ from the plant's.
    most_effects : int
        Largest number of effects on a joint that are looked for.
    given : mapping of joint to GivenPhysics, optional
        The physics of each joint, if it is not to be searched.
    left_out : tuple of str
        Effects whose formulas are not tried, so that a law in none of the known forms can be met.
    jobs : int
        Tasks side by side.
    progress : callable, optional
        Told in a few words what is being done.

    Returns
    -------
    Explanation
    """
    begun = time.monotonic()
    tell = progress or (lambda _: None)
    observations = with_held_noise(observe(recording, plant))
    if not _is_enough(observations):
        return Explanation.without_fit(Verdict.INSUFFICIENT_DATA, plant)
    tell('refitting the nominal plant')
    well = plant
    known = {o.joint: left_out for o in observations}
    if baseline is not None:
        tell('searching what the baseline lacks')
        observations, well, known = _healthy(observations, baseline, plant, band, left_out, jobs)
        band = SAME_RIG
    observations, anchors = anchored(recording, observations, well, band, jobs)

    def searched(index: int) -> JointSearch:
        joint = observations[index].joint
        if given is not None:
            return explained_by(anchors[index], given[joint], jobs)
        return search(anchors[index], jobs, most_effects, known[joint])

    searches, decisions = [], []
    for index, observation in enumerate(observations):
        tell(f'searching what {observation.joint} lacks')
        searches.append(searched(index))
        decisions.append(decide(searches[-1]))
    for joint in _misled_by_the_other(decisions):
        tell(
            f'searching what {observations[joint].joint} lacks beside the other joint as explained'
        )
        couple(observations, tuple(simulated_bending(d.chosen.fit) for d in decisions))
        searches[joint] = searched(joint)
        decisions[joint] = decide(searches[joint])
    decisions = with_devices_agreed(searches, decisions)
    unknown, final = None, [d.chosen.fit for d in decisions]
    worst = _worst(decisions)
    if worst is not None:
        tell(f'looking for physics outside the catalogue on {observations[worst].joint}')
        found = unknown_physics(final[worst], jobs, _siblings(searches[worst]))
        if found is not None:
            unknown, final[worst] = found
    tell('judging on held-out blocks')
    pairs = tuple(zip(observations, decisions, strict=True))
    effects = named(observations, decisions)
    return Explanation(
        verdict_of(effects, decisions),
        effects,
        {
            o.joint: nominal_estimates(d.chosen.fit, packed_joint(plant, o.joint)[0], NOMINAL_UNITS)
            for o, d in pairs
        },
        plant,
        plant_of(
            well,
            [refitted(s, d).fit for s, d in zip(searches, decisions, strict=True)],
            [() for _ in searches],
        ),
        with_term(plant_of(well, final, [d.chosen.effects for d in decisions]), unknown),
        ladder(anchors, searches, decisions, final),
        candidates(observations, searches),
        unknown,
        all(d.adequate for d in decisions),
        {f'explained_{o.joint}': d.explained for o, d in pairs},
        baseline is not None,
        time.monotonic() - begun,
    )


def _healthy(
    observations: tuple[JointObservation, ...],
    baseline: Recording,
    plant: PlantDescription,
    band: float,
    left_out: tuple[str, ...],
    jobs: int,
) -> tuple[tuple[JointObservation, ...], PlantDescription, dict[str, tuple[str, ...]]]:
    """Observations against a baseline, the plant in health, and the effects it has on each joint.

    A rig that never matched the plant is described by the effect that comes nearest, right or not:
    less is left that could hide what is new.
    """
    before = with_held_noise(observe(baseline, plant))
    packed = {o.joint: packed_joint(plant, o.joint) for o in before}
    healthy = [
        min(tried.tried(), key=lambda c: c.score)
        for tried in (
            search(pair, jobs, 1, left_out) for pair in all_anchors(before, packed, jobs, band)
        )
    ]
    by_joint = {c.fit.model.observation.joint: c for c in healthy}
    seen = tuple(against_baseline(o, by_joint[o.joint].fit) for o in observations)
    well = plant_of(plant, [c.fit for c in healthy], [c.effects for c in healthy])
    return seen, well, {joint: (*left_out, *c.effects) for joint, c in by_joint.items()}


def _misled_by_the_other(decisions: list[Decision]) -> list[int]:
    """Joints not explained while the other one, which may move them, was taken for nominal."""
    return [
        i
        for i, decision in enumerate(decisions)
        if not decision.adequate
        and any(
            other.adequate and other.chosen.effects for other in decisions if other is not decision
        )
    ]


def _worst(decisions: list[Decision]) -> int | None:
    """Index of the joint that is explained least, of those that are not."""
    unexplained = [i for i, d in enumerate(decisions) if not d.adequate]
    return max(unexplained, key=lambda i: decisions[i].chosen.score, default=None)


def _siblings(tried: JointSearch) -> tuple[str, ...]:
    """Effects that alone came nearest."""
    tried_alone = [c.effects[0] for level in tried.levels[:1] for c in level if c.effects]
    return tuple(dict.fromkeys(tried_alone))[:SIBLINGS]


def _is_enough(observations: tuple[JointObservation, ...]) -> bool:
    return any(
        o.channels
        and o.inputs.shape[1] * 1e-3 >= LEAST_DURATION_S
        and np.ptp(o.inputs[0, :, 0]) >= LEAST_MOTION_RAD
        and all(
            np.ptp(c.value) >= LEAST_MOTION_RAD
            for c in o.channels
            if c.quantity == 'shaft_position'
        )
        for o in observations
    )
