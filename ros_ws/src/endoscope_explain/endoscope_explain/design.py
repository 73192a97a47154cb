"""The motion that separates the rivals of an explanation best.

The smallest distance between any two rivals, each refitted to the other, is maximised over a
family of safe motions (Hunter, Reiner, Technometrics 7, 1965; Chen, Asprey, Ind. Eng. Chem. Res.
42, 2003).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.effects import KNOWN, describe
from endoscope_core.physics.packing import without_functions
from endoscope_core.physics.simulator import TICK, simulate
from endoscope_core.rig import Rig
from endoscope_core.safety import MotionLimits, MotionShaper
from endoscope_core.signals.command_file import JOINTS
from endoscope_core.workers import parallel_map
from endoscope_explain.case import NextExperiment
from endoscope_explain.decide.conclusions import spec_of
from endoscope_explain.experiment_motions import SAMPLE_S, Waveform, family
from endoscope_explain.explanation import NamedEffect
from endoscope_explain.fit.free_parameters import LEAD, effect_parameters, nominal_parameters
from endoscope_explain.fit.model import Fit, JointModel, fit, jacobian, joint_of, packed_joint
from endoscope_explain.observe.observation import JointObservation, observe
from endoscope_explain.prediction_set import OTHER_NUMBERS
from endoscope_explain.recording import Recording, Series
from endoscope_explain.search.screen import background, directions, screened
from endoscope_explain.search.term import Term, starting_points

Array = NDArray[np.float64]

SETTLES_S = 1.0
"""Most that a motion may end later than was asked for, because the rig is slower."""


def as_played(time: Array, angle: Array, rig: Rig) -> tuple[Array, Array]:
    """A motion (N, J) in rad at times (N,) as the console plays it: within a rig's limits."""
    facts = rig.joints
    joints = angle.shape[1]
    shaper = MotionShaper(
        MotionLimits.either_way(
            joints, facts.reach, facts.speed, facts.acceleration, facts.entry_step
        )
    )
    ticks = np.arange(time[0], time[-1] + SETTLES_S, TICK)
    wanted = np.stack([np.interp(ticks, time, column) for column in angle.T], axis=1)
    shaper.restart(wanted[0])
    shaped = np.array([shaper.shape(each, TICK) for each in wanted.tolist()])
    every = round(SAMPLE_S / TICK)
    return ticks[::every], shaped[::every]


MOST_RIVALS = 3
MARGIN = 1.15
"""How far a proposed motion may go beyond the tensions and angles that were recorded."""
SURE = 1.96
"""Standard deviations by which a motion must be expected to tell rivals apart: 97.5 %."""
HALVED = 0.5
"""Share of an interval's width that a motion must leave at most to be worth it: the recording made
once more leaves 0.7."""
WIDE = 0.25
"""Half width of a strength's 90 % interval, as a share of it, that is worth another motion."""
NOMINAL_BAND = 0.05
"""Relative freedom that nominal parameters still have after a first recording."""
REFIT_STEPS = 3


def refit(
    plant: PlantDescription, observation: JointObservation, band: float, iterations: int
) -> Fit:
    """Refit one joint of a plant, its effects included, from where it is."""
    base, flags = packed_joint(plant, observation.joint)
    free = nominal_parameters(base, band)
    for spec in plant.effects:
        if spec.joint == observation.joint:
            free += effect_parameters(spec.id)
    model = JointModel(observation, base, flags, free)
    start = np.array(
        [item.coordinate(1.0 if item.index == LEAD else float(base[item.index])) for item in free]
    )
    return fit(model, start, iterations=iterations)


def with_fit(plant: PlantDescription, joint: str, found: Fit) -> PlantDescription:
    """Put the fitted numbers of one joint back into a plant."""
    packed, _ = found.model.packed(found.theta)
    effects = tuple(
        spec_of(describe(spec.id), joint, packed) if spec.joint == joint else spec
        for spec in plant.effects
    )
    return replace(plant, joints={**plant.joints, joint: joint_of(packed)}, effects=effects)


def left_over(truth: Recording, rival: PlantDescription, joint: str) -> Array:
    """What a rival misses (size,), in noise, of the other's noise-free answer after its refit."""
    observation = next(o for o in observe(truth, rival) if o.joint == joint)
    return refit(rival, observation, NOMINAL_BAND, REFIT_STEPS).residuals


def imagine(plant: PlantDescription, waveform: Waveform, rig: Rig) -> Recording:
    """A plant's noise-free answer to the motion of one joint."""
    joints = plant.joint_names()
    desired = np.zeros((len(waveform.time), len(joints)))
    desired[:, joints.index(waveform.joint)] = waveform.angle
    return answer_to(plant, waveform.name, waveform.time, desired, rig)


def answer_to(plant: PlantDescription, name: str, time: Array, angle: Array, rig: Rig) -> Recording:
    """A plant's noise-free answer to a motion (N, J) in rad at times (N,)."""
    # The tracker at its rate, all else every tick.
    ticks = np.arange(0.0, time[-1], TICK)
    desired = np.stack([np.interp(ticks, time, column) for column in angle.T], axis=1)
    shaft = rig.joints.gear * desired
    answer = simulate(plant, shaft)
    slow = slice(None, None, max(1, round(1.0 / (plant.sensors.tracker_rate * TICK))))
    return Recording(
        name,
        0.0,
        plant.joint_names(),
        Series.of('motor/servo_jp', ticks, shaft),
        Series.of('wires/measured_js', ticks, answer.tension),
        Series.of('slave/measured_js', ticks[slow], answer.bending[slow]),
        Series.of('motor/measured_js', ticks, answer.shaft_position),
        Series.of('motor/measured_js', ticks, answer.shaft_velocity),
        Series.of('motor/measured_js', ticks, answer.shaft_effort),
        rig=rig,
    )


def is_safe(
    recording: Recording,
    tension_limit: float,
    bending_limit: float,
    slack_limit: float = 0.0,
) -> bool:
    """Tell whether an imagined motion stays within tensions in N and an angle in rad."""
    assert recording.tension is not None
    return bool(
        recording.tension.values.max() <= tension_limit
        and recording.tension.values.min() >= slack_limit
        and np.abs(recording.bending.values).max() <= bending_limit
    )


Played = Collection[tuple[str, str]]
"""Waveforms and the joints that they moved."""


def propose(
    recording: Recording,
    plant: PlantDescription,
    effect: NamedEffect,
    jobs: int = 1,
    played: Played = (),
    left: float = 1.0,
) -> NextExperiment | None:
    """Propose the motion that tells an effect, which `plant` has, from its alternatives.

    None where there is no rival, or where no safe motion, but those that were played, is expected
    to show more than an error of form may. What the plant leaves of a recording, in its noise
    (rms), weighs against what a motion shows.
    """
    plants = {effect.id: plant} | {
        rival: fitted
        for rival in effect.alternatives[: MOST_RIVALS - 1]
        if (fitted := rival_plant(recording, plant, effect, rival)) is not None
    }
    form = effect.evidence.get('form', 0.0)
    return _separating(recording, plants, effect.joint, jobs, played, left, form)


def propose_beside_numbers(
    recording: Recording,
    plant: PlantDescription,
    described: PlantDescription,
    joint: str,
    effects: Sequence[str],
    jobs: int = 1,
    played: Played = (),
    left: float = 1.0,
) -> NextExperiment | None:
    """Propose the motion that tells other numbers of a joint, which `plant` has, from effects.

    With an effect the joint has about the numbers that were `described`. None as in `propose`.
    """
    bare = replace(plant, joints={**plant.joints, joint: described.joints[joint]})
    there = {e.id for e in plant.effects if e.joint == joint}
    rivals = [e for e in effects if e in KNOWN and e not in there]
    plants = {OTHER_NUMBERS: plant} | {
        rival: fitted
        for rival in rivals[: MOST_RIVALS - 1]
        if (fitted := _with_effect(recording, bare, joint, rival)) is not None
    }
    return _separating(recording, plants, joint, jobs, played, left)


def _separating(
    recording: Recording,
    plants: Mapping[str, PlantDescription],
    joint: str,
    jobs: int,
    played: Played,
    left: float,
    form: float = 0.0,
) -> NextExperiment | None:
    """The motion of a joint that separates plants best, by their names; None as in `propose`."""
    if len(plants) < 2:
        return None
    motions = [
        motion
        for motion in safe_family(recording, list(plants.values()), joint)
        if (motion.name, motion.joint) not in played
    ]
    if not motions:
        return None

    def smallest(waveform: Waveform) -> tuple[float, float]:
        imagined = {name: imagine(p, waveform, recording.rig) for name, p in plants.items()}
        if recording.tension is None:
            imagined = {name: replace(r, tension=None) for name, r in imagined.items()}
        missed = [left_over(imagined[a], plants[b], joint) for a, b in permutations(plants, 2)]
        nats = min(0.5 * float(np.sum(each**2)) for each in missed)
        return min(float(np.sqrt(np.mean(each**2))) for each in missed), nats

    found = parallel_map(smallest, motions, jobs)
    best = int(np.argmax([apart for apart, _ in found]))
    apart, nats = found[best]
    if not tells_apart(nats / max(left, 1.0) ** 2, form):
        return None
    rivals = ' and '.join(plants)
    return _experiment(
        motions[best],
        f'{motions[best].name.capitalize()} of {motions[best].joint} would tell {rivals} apart. '
        f'Each refitted to the other, they still differ by {apart:.1f} times the noise at least.',
        tuple(plants),
        {m.name: d for m, (d, _) in zip(motions, found, strict=True)},
    )


def tells_apart(nats: float, form: float) -> bool:
    """Whether evidence of so many nats is expected to stand out from noise and errors of form."""
    # Evidence of x nats between two laws scatters by the root of 2 x (Cox, J. R. Stat. Soc. B 24,
    # 1962).
    return nats - SURE * np.sqrt(2.0 * nats) > form


def _experiment(
    motion: Waveform, why: str, separates: tuple[str, ...], distances: dict[str, float]
) -> NextExperiment:
    columns = np.zeros((len(motion.time), len(JOINTS)))
    columns[:, JOINTS.index(motion.joint)] = motion.angle
    return NextExperiment(
        why,
        separates,
        motion.name,
        motion.joint,
        distances,
        tuple(map(float, motion.time)),
        tuple((float(row[0]), float(row[1])) for row in columns),
        JOINTS,
    )


def is_wide(effect: NamedEffect) -> bool:
    """Whether the strength of an effect is known by no more than its order of magnitude."""
    first = effect.parameters.get(effect.definition.parameters[0].name)
    return first is not None and 0.5 * (first.high - first.low) > WIDE * abs(first.value)


def narrow(
    recording: Recording,
    plant: PlantDescription,
    effect: NamedEffect,
    jobs: int = 1,
    played: Played = (),
) -> NextExperiment | None:
    """Propose the motion that narrows the interval of an effect's strength, which `plant` has.

    None where no safe motion, but those that were played, is expected to halve it. The precision is
    what the recording and the motion have of it together, by white noise (Box, Lucas, Biometrika
    46, 1959).
    """
    base, flags = packed_joint(plant, effect.joint)
    free = nominal_parameters(base, NOMINAL_BAND) + effect_parameters(effect.id)
    strength = [k for k, item in enumerate(free) if item.index == effect.definition.places[0]]
    if not strength:
        return None

    def seen(recording: Recording) -> JointModel:
        observation = next(o for o in observe(recording, plant) if o.joint == effect.joint)
        return JointModel(observation, base, flags, free)

    def precision(model: JointModel) -> Array:
        theta = [i.coordinate(1.0 if i.index == LEAD else float(base[i.index])) for i in free]
        slope = jacobian(model, np.array(theta))
        return np.asarray(slope.T @ slope)

    own = seen(recording)
    before = precision(own) + np.diag(own.prior_weight() ** 2)

    def deviation(known: Array) -> float:
        return float(np.sqrt(np.linalg.inv(known)[strength[0], strength[0]]))

    motions = [
        motion
        for motion in safe_family(recording, [plant], effect.joint)
        if (motion.name, motion.joint) not in played
    ]
    after = parallel_map(
        lambda m: deviation(before + precision(seen(imagine(plant, m, recording.rig)))),
        motions,
        jobs,
    )
    shares = [each / deviation(before) for each in after]
    if not shares or min(shares) > HALVED:
        return None
    best = motions[int(np.argmin(shares))]
    name = effect.definition.parameters[0].name
    return _experiment(
        best,
        f'{best.name.capitalize()} of {best.joint} would leave {min(shares):.0%} of the interval '
        f'of {name} of {effect.id}.',
        (effect.id,),
        {},
    )


def rival_plant(
    recording: Recording, plant: PlantDescription, effect: NamedEffect, rival: str
) -> PlantDescription | None:
    """Fit a rival in an effect's place; None where it has no simulation or is there besides."""
    there = {e.id for e in plant.effects if e.joint == effect.joint}
    if rival not in KNOWN or rival in there:
        return None
    others = tuple(e for e in plant.effects if (e.id, e.joint) != (effect.id, effect.joint))
    places = (effect.id, *effect.definition.traits.families)
    bare = without_functions(replace(plant, effects=others), effect.joint, places)
    return _with_effect(recording, bare, effect.joint, rival)


def _with_effect(
    recording: Recording, bare: PlantDescription, joint: str, rival: str
) -> PlantDescription | None:
    """Fit an effect that a plant has not; None where nothing of it shows."""
    observation = next(o for o in observe(recording, bare) if o.joint == joint)
    behind = background(refit(bare, observation, 0.2, 2))
    terms = tuple(Term(describe(rival), start) for start in starting_points(describe(rival)))
    ways = directions(behind, terms, 1)
    if not ways:
        return None
    # Beside numbers that are bent by what was taken out, a rival may gain nothing at its starts.
    ranked = screened(behind, ways) or [ways[0].term]
    packed = ranked[0].added_to(behind.fit.model).base
    term = replace(bare, effects=(*bare.effects, spec_of(describe(rival), joint, packed)))
    return with_fit(term, joint, refit(term, observation, 0.2, 6))


def safe_family(
    recording: Recording, plants: Sequence[PlantDescription], joint: str
) -> list[Waveform]:
    """List motions that keep every rival within what the rig has been through."""
    j = recording.joints.index(joint)
    reach = float(np.abs(recording.command.values[:, j]).max()) / recording.gear
    tension, slack = recording.rig.tension.calibration_ceiling, 0.0
    if recording.tension is not None:
        seen = recording.tension.values[recording.tension.valid]
        tension = min(tension, MARGIN * float(seen.max()))
        slack = float(seen.min()) / MARGIN
    bending = MARGIN * float(np.abs(recording.bending.values[recording.bending.valid]).max())
    others = tuple(name for name in recording.joints if name != joint)
    safe: list[Waveform] = []
    for full in family(joint, others, reach):
        for share in (1.0, 0.75, 0.5, 0.3):
            time, angle = as_played(full.time, share * full.angle[:, None], recording.rig)
            waveform = replace(full, time=time, angle=angle[:, 0])
            answers = (imagine(p, waveform, recording.rig) for p in plants)
            if all(is_safe(each, tension, bending, slack) for each in answers):
                safe.append(waveform)
                break
    return safe
