"""Which effects explain several recordings of one rig best together.

A rig whose tube is bent differently from one recording to the next keeps its physics, and only its
parameters change. Explained one by one, two recordings may well be given different names for the
same misfit; the effects are therefore chosen by the sum of all scores, and fitted one by one.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from endoscope_core.effects import CATALOGUE
from endoscope_explain.agreement import agreed_parameters, in_line, must_agree
from endoscope_explain.anchoring import anchored
from endoscope_explain.compose import searchable_effects
from endoscope_explain.fit import Fit, JointModel
from endoscope_explain.given_physics import GivenJoints, GivenPhysics, settled, without_recording
from endoscope_explain.glance import Glance, glance
from endoscope_explain.held_noise import with_held_noise
from endoscope_explain.observation import observe
from endoscope_explain.parallel import parallel_map
from endoscope_explain.parallel_fits import parallel_fits
from endoscope_explain.pipeline import JointsDifferError, Sources, read_inputs
from endoscope_explain.rank import Look, polish
from endoscope_explain.repeated_motion import DEPENDS_ON_TIME, motion_repeats
from endoscope_explain.score import score
from endoscope_explain.screen import promises, unexplained

Array = NDArray[np.float64]
Anchors = tuple[Fit, ...]

STARTS = 2
"""Starting points of an effect that get a cheap fit."""
POLISHED = 6
"""Effects that are fitted fully to all recordings before one is chosen."""
LEAST_FALL = 10.0
"""Fall of the score per recording that an effect must bring."""


def physics_of_all(
    sources: Sequence[Sources], jobs: int, tell: Callable[[str], None]
) -> list[GivenJoints]:
    """Read several recordings of a rig and choose the effects that explain all of them.

    Parameters
    ----------
    sources : sequence of Sources
    jobs : int
        Processes side by side.
    tell : callable
        Told what is being done.

    Returns
    -------
    list of mapping of joint name to GivenPhysics
        For each recording.

    Raises
    ------
    BagError
        If a recording cannot be used, or has other joints than the first one.
    """
    recordings: list[dict[str, Anchors]] = []
    with threadpool_limits(1, 'blas'):
        for one in sources:
            inputs = read_inputs(one)
            recording = inputs.audit.recording
            tell(f'{recording.name}: refitting the nominal plant')
            _, anchors = anchored(
                recording,
                with_held_noise(observe(recording, inputs.plant)),
                inputs.plant,
                inputs.band,
                jobs,
                tightened=inputs.tightened,
            )
            joints = recording.joints
            if recordings and set(joints) != set(recordings[0]):
                raise JointsDifferError(
                    f'{one.bag}: has {", ".join(joints)}, but {sources[0].bag} has '
                    f'{", ".join(recordings[0])}'
                )
            recordings.append(dict(zip(joints, anchors, strict=True)))
        return shared_effects(recordings, sources[0].most_effects, jobs, tell)


def shared_effects(
    recordings: Sequence[Mapping[str, Anchors]],
    most_effects: int,
    jobs: int,
    tell: Callable[[str], None],
) -> list[GivenJoints]:
    """Choose effects for all recordings of a rig together.

    Parameters
    ----------
    recordings : sequence of mapping of joint name to anchors
        Nominal fits of each joint of each recording; see `rank.look`.
    most_effects : int
        Largest number of effects on a joint.
    jobs : int
        Processes side by side.
    tell : callable
        Told each effect when it is chosen.

    Returns
    -------
    list of mapping of joint name to GivenPhysics
        For each recording; the effects are those of all, in the order in which they were added.
    """
    given: list[dict[str, GivenPhysics]] = [{} for _ in recordings]
    for joint in recordings[0]:
        parents: list[Anchors] = [anchors[joint] for anchors in recordings]
        effects: tuple[str, ...] = ()
        while len(effects) < most_effects:
            tell(f'{joint}: what all recordings lack beside {", ".join(effects) or "nothing"}')
            found = _next_effect(parents, effects, jobs)
            if found is None:
                break
            effect_id, parents, fall = found
            effects = (*effects, effect_id)
            tell(f'{joint}: {effect_id}, by {fall:.0f} per recording')
        for physics, anchors in zip(given, parents, strict=True):
            flags = anchors[0].model.flags
            own = tuple(e for e in effects if flags[CATALOGUE[e].flag])
            physics[joint] = without_recording(own, anchors[0])
    return list(given)


def _next_effect(
    parents: list[Anchors], effects: tuple[str, ...], jobs: int
) -> tuple[str, list[Anchors], float] | None:
    """The effect that brings most, all recordings with it, and its mean fall of the score."""
    repeated = all(motion_repeats(anchors[0].model.observation) for anchors in parents)
    tried = [
        e
        for e in searchable_effects()
        if e not in effects and (repeated or e not in DEPENDS_ON_TIME)
    ]
    glances = _glances(parents, effects, tried, jobs)
    promising = sorted(tried, key=lambda e: _logarithm_of_costs(parents, glances[e]))[:POLISHED]
    grown = {e: _grown(parents, effects, e, glances[e], jobs) for e in promising}
    total = {e: _total(grown[e]) for e in promising}
    best = min(total, key=lambda e: total[e])
    chosen = _borrowed(grown[best], jobs)
    fall = (_total(parents) - _total(chosen)) / len(parents)
    return (best, chosen, fall) if fall >= LEAST_FALL else None


def _total(recordings: Sequence[Anchors]) -> float:
    return sum(score(anchors[0]) for anchors in recordings)


def _glances(
    parents: list[Anchors], effects: tuple[str, ...], tried: Sequence[str], jobs: int
) -> dict[str, list[Glance | None]]:
    tasks = [(e, n) for e in tried for n in range(len(parents))]
    left = [unexplained(anchors[0]) for anchors in parents]

    def glanced(task: tuple[str, int]) -> Glance | None:
        effect_id, n = task
        starts = promises(left[n], effect_id)[:STARTS]
        found = [glance(parents[n], effects, start) for start in starts]
        return min(found, key=lambda item: item.cost, default=None)

    found = iter(parallel_map(glanced, tasks, jobs))
    return {e: [next(found) for _ in parents] for e in tried}


def _logarithm_of_costs(parents: list[Anchors], glances: list[Glance | None]) -> float:
    return sum(
        math.log(anchors[0].cost if item is None else min(item.cost, anchors[0].cost))
        for anchors, item in zip(parents, glances, strict=True)
    )


def _grown(
    parents: list[Anchors],
    effects: tuple[str, ...],
    effect_id: str,
    glances: list[Glance | None],
    jobs: int,
) -> list[Anchors]:
    """All recordings with one more effect; a recording that has no use for it stays as it is."""
    wanted = [n for n, item in enumerate(glances) if item is not None]
    begun = [
        item.look(anchors, effects)
        for anchors, item in zip(parents, glances, strict=True)
        if item is not None
    ]
    fits = parallel_fits(lambda i: _separate(begun[i]), [item.model for item in begun], jobs)
    if must_agree(effect_id) and fits:
        agreed = agreed_parameters(fits, effect_id)
        held = [in_line(f, effect_id, agreed) for f in fits]
        fits = parallel_fits(lambda i: settled(*held[i]), [model for model, _ in held], jobs)
    grown = list(parents)
    for n, f in zip(wanted, fits, strict=True):
        grown[n] = (f,)
    return grown


def _separate(item: Look) -> Fit:
    begun = polish(item)
    return settled(begun.model, begun.theta)


def _borrowed(recordings: list[Anchors], jobs: int) -> list[Anchors]:
    """Each recording fitted once more from the neighbour whose numbers suit it best.

    The numbers of one rig in two shapes are alike, and a fit by itself may lie in a worse valley.
    """
    begun = [
        min(
            (
                _moved_to(anchors[0], other[0])
                for m, other in enumerate(recordings)
                if m != n and len(other[0].theta) == len(anchors[0].theta)
            ),
            key=lambda b: float(np.sum(b[0].residuals(b[1]) ** 2)),
            default=(anchors[0].model, anchors[0].theta),
        )
        for n, anchors in enumerate(recordings)
    ]
    fits = parallel_fits(lambda i: settled(*begun[i]), [model for model, _ in begun], jobs)
    return [
        (other,) if score(other) < score(anchors[0]) else anchors
        for anchors, other in zip(recordings, fits, strict=True)
    ]


def _moved_to(own: Fit, other: Fit) -> tuple[JointModel, Array]:
    """Another recording's physics, with its numbers, on one's own recording."""
    return replace(other.model, observation=own.model.observation), other.theta
