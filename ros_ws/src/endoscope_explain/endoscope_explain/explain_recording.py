"""From a cleaned recording and a plant description to named effects."""

import time
from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.effects import CATALOGUE, Stage
from endoscope_core.plant import EffectSpec, JointParameters, PlantDescription
from endoscope_explain.baseline import against_baseline
from endoscope_explain.decision import Decision, decide, with_devices_agreed
from endoscope_explain.evaluate import packed_joint
from endoscope_explain.explanation import (
    Candidate,
    ChannelFit,
    Explanation,
    NamedEffect,
    NominalEstimate,
    Verdict,
)
from endoscope_explain.fit import Fit
from endoscope_explain.free_parameters import BAND
from endoscope_explain.held_noise import with_held_noise
from endoscope_explain.held_out import held_out_fit, held_out_masks, on_samples
from endoscope_explain.intervals import effect_estimates, nominal_estimates
from endoscope_explain.isolated_samples import without_isolated
from endoscope_explain.latent import unknown_term
from endoscope_explain.observation import JointObservation, couple, observe
from endoscope_explain.probability import probability
from endoscope_explain.recording import Recording
from endoscope_explain.score import misfit
from endoscope_explain.search import (
    MOST_EFFECTS,
    JointSearch,
    all_anchors,
    search,
    simulated_bending,
)

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Progress = Callable[[str], None]

LEAST_DURATION_S = 2.0
LEAST_MOTION_RAD = 0.02
SAME_RIG = 0.03
"""Relative tolerance of a nominal parameter from one recording of a rig to the next."""
SIBLINGS = 3
CHANGED = 0.04
"""Relative difference of a nominal parameter that is worth a verdict."""
NOMINAL_UNITS = {
    'pretension': 'N',
    'wire_stiffness': 'N/m',
    'joint_radius': 'm',
    'pulley_radius': 'm',
    'capstan_exponent': '-',
    'presliding_distance': 'm',
    'joint_stiffness': 'N m/rad',
    'joint_damping': 'N m s/rad',
    'joint_friction': 'N m',
    'joint_presliding': 'rad',
    'motor_bandwidth': 'rad/s',
    'motor_damping_ratio': '-',
}


def explain_recording(
    recording: Recording,
    plant: PlantDescription,
    *,
    baseline: Recording | None = None,
    band: float = BAND,
    most_effects: int = MOST_EFFECTS,
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
    jobs : int
        Processes side by side.
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
        return Explanation(
            Verdict.INSUFFICIENT_DATA,
            (),
            {},
            plant,
            plant,
            plant,
            {},
            runtime_s=time.monotonic() - begun,
        )
    tell('refitting the nominal plant')
    well = plant
    known: dict[str, tuple[str, ...]] = {o.joint: () for o in observations}
    if baseline is not None:
        tell('searching what the baseline lacks')
        observations, well, known = _healthy(observations, baseline, plant, band, jobs)
        band = SAME_RIG
    packed = {o.joint: packed_joint(well, o.joint) for o in observations}
    anchors = all_anchors(observations, packed, jobs, band)
    cleaned = without_isolated(recording, observations, tuple(fitted for fitted, _ in anchors))
    if cleaned is not observations:
        observations = cleaned
        anchors = all_anchors(observations, packed, jobs, band)
    searches, decisions = [], []
    for observation, pair in zip(observations, anchors, strict=True):
        tell(f'searching what {observation.joint} lacks')
        searches.append(search(pair, jobs, most_effects, known[observation.joint]))
        decisions.append(decide(searches[-1]))
    for joint in _misled_by_the_other(decisions):
        tell(
            f'searching what {observations[joint].joint} lacks beside the other joint as explained'
        )
        couple(observations, tuple(simulated_bending(d.chosen.fit) for d in decisions))
        lacking = known[observations[joint].joint]
        searches[joint] = search(anchors[joint], jobs, most_effects, lacking)
        decisions[joint] = decide(searches[joint])
    decisions = with_devices_agreed(searches, decisions)
    unknown = None
    worst = _worst(decisions)
    if worst is not None:
        tell(f'looking for physics outside the catalogue on {observations[worst].joint}')
        unknown = unknown_term(decisions[worst].chosen.fit, jobs, _siblings(searches[worst]))
    tell('judging on held-out blocks')
    effects = _named(observations, decisions)
    verdict = _verdict(effects, decisions)
    return Explanation(
        verdict,
        effects,
        {
            o.joint: nominal_estimates(d.chosen.fit, packed_joint(plant, o.joint)[0], NOMINAL_UNITS)
            for o, d in zip(observations, decisions, strict=True)
        },
        plant,
        _plant_of(well, [s.nominal.fit for s in searches], [() for _ in searches]),
        _plant_of(well, [d.chosen.fit for d in decisions], [d.chosen.effects for d in decisions]),
        _ladder(anchors, searches, decisions),
        _candidates(observations, searches),
        unknown,
        all(d.adequate for d in decisions),
        {f'explained_{o.joint}': d.explained for o, d in zip(observations, decisions, strict=True)},
        baseline is not None,
        time.monotonic() - begun,
    )


def _healthy(
    observations: tuple[JointObservation, ...],
    baseline: Recording,
    plant: PlantDescription,
    band: float,
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
            search(pair, jobs, depth=1) for pair in all_anchors(before, packed, jobs, band)
        )
    ]
    by_joint = {c.fit.model.observation.joint: c for c in healthy}
    seen = tuple(against_baseline(o, by_joint[o.joint].fit) for o in observations)
    well = _plant_of(plant, [c.fit for c in healthy], [c.effects for c in healthy])
    return seen, well, {joint: c.effects for joint, c in by_joint.items()}


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
    return tuple(c.effects[0] for c in tried.levels[0][:SIBLINGS]) if tried.levels else ()


def _is_enough(observations: tuple[JointObservation, ...]) -> bool:
    return any(
        o.channels
        and o.inputs.shape[1] * 1e-3 >= LEAST_DURATION_S
        and np.ptp(o.inputs[0, :, 0]) >= LEAST_MOTION_RAD
        for o in observations
    )


def _named(
    observations: tuple[JointObservation, ...], decisions: list[Decision]
) -> tuple[NamedEffect, ...]:
    effects = []
    for observation, decision in zip(observations, decisions, strict=True):
        for effect_id in decision.chosen.effects:
            definition = CATALOGUE[effect_id]
            rivals = decision.alternatives[effect_id]
            effects.append(
                NamedEffect(
                    effect_id,
                    observation.joint,
                    str(definition.stage),
                    probability(
                        decision.gaps[effect_id],
                        decision.margins[effect_id],
                        decision.adequate,
                        len(rivals),
                    ),
                    definition.equation,
                    definition.source,
                    effect_estimates(
                        decision.chosen.fit,
                        definition.first_parameter,
                        {p.name: p.unit for p in definition.parameters},
                    ),
                    rivals,
                    {
                        'margin': decision.margins[effect_id],
                        'gap': decision.gaps[effect_id],
                        'explained': decision.explained,
                    },
                )
            )
    ordered = sorted(effects, key=lambda e: (-e.probability, -e.evidence['margin']))
    # A clock belongs to a device, not to a joint; a tracker's fault shows on both. Each id comes
    # once before any comes again.
    once: dict[tuple[str, str], NamedEffect] = {}
    for effect in ordered:
        shared = CATALOGUE[effect.id].stage == Stage.RECORDING
        once.setdefault((effect.id, '' if shared else effect.joint), effect)
    seen: set[str] = set()
    first: list[NamedEffect] = []
    again: list[NamedEffect] = []
    for effect in once.values():
        (again if effect.id in seen else first).append(effect)
        seen.add(effect.id)
    return tuple(first + again)


def _verdict(effects: tuple[NamedEffect, ...], decisions: list[Decision]) -> Verdict:
    if not all(d.adequate for d in decisions):
        return Verdict.UNKNOWN_PHYSICS
    stages = {effect.stage for effect in effects}
    if stages & {Stage.ACTUATOR, Stage.TRANSMISSION, Stage.JOINT}:
        return Verdict.MISSING_PHYSICS
    if Stage.SENSING in stages:
        return Verdict.SENSOR_FAULT
    if Stage.RECORDING in stages:
        return Verdict.RECORDING_FAULT
    changed = any(
        _has_changed(e)
        for d in decisions
        for e in nominal_estimates(d.chosen.fit, d.chosen.fit.model.base, NOMINAL_UNITS).values()
    )
    return Verdict.PARAMETERS_DIFFER if changed else Verdict.CONSISTENT


def _has_changed(estimate: NominalEstimate) -> bool:
    outside = estimate.low > estimate.nominal or estimate.high < estimate.nominal
    return outside and abs(np.log(estimate.value / estimate.nominal)) > CHANGED


def _plant_of(
    plant: PlantDescription, fits: list[Fit], effects: list[tuple[str, ...]]
) -> PlantDescription:
    joints, specs = dict(plant.joints), list(plant.effects)
    for f, added in zip(fits, effects, strict=True):
        joint = f.model.observation.joint
        packed, _ = f.model.packed(f.theta)
        names = [item.name for item in fields(JointParameters)]
        joints[joint] = JointParameters(
            **{name: float(value) for name, value in zip(names, packed, strict=False)}
        )
        for effect_id in added:
            definition = CATALOGUE[effect_id]
            first = definition.first_parameter
            specs.append(
                EffectSpec(
                    effect_id,
                    joint,
                    {p.name: float(packed[first + i]) for i, p in enumerate(definition.parameters)},
                )
            )
    return replace(plant, joints=joints, effects=tuple(specs))


def _ladder(
    anchors: list[tuple[Fit, Fit]], searches: list[JointSearch], decisions: list[Decision]
) -> dict[str, dict[str, ChannelFit]]:
    rungs: dict[str, dict[str, ChannelFit]] = {'nominal': {}, 'refitted': {}, 'augmented': {}}
    for (_, described), tried, decision in zip(anchors, searches, decisions, strict=True):
        observation = described.model.observation
        judged, _ = held_out_masks(observation)
        rungs['nominal'] |= on_samples(observation, described.residuals, judged)
        rungs['refitted'] |= held_out_fit(tried.nominal.fit)
        rungs['augmented'] |= (
            held_out_fit(decision.chosen.fit)
            if decision.chosen.effects
            else {s.signal: rungs['refitted'][s.signal] for s in observation.channels}
        )
    return rungs


def _candidates(
    observations: tuple[JointObservation, ...], searches: list[JointSearch]
) -> tuple[Candidate, ...]:
    found = []
    for observation, tried in zip(observations, searches, strict=True):
        for c in tried.tried():
            found.append(
                Candidate(
                    tuple((effect_id, observation.joint) for effect_id in c.effects),
                    c.score,
                    misfit(c.fit).total / observation.size,
                )
            )
    return tuple(sorted(found, key=lambda c: c.score))
