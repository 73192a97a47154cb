"""Which effects explain several recordings of one rig best together.

A rig whose tube is bent differently from one recording to the next keeps its physics, and only its
parameters change. Explained one by one, two recordings may well be given different names for the
same misfit; the effects are therefore chosen by the sum of the evidence, and fitted together.
"""

from collections.abc import Callable, Mapping, Sequence

from threadpoolctl import threadpool_limits

from endoscope_core.physics.effects import describe, lacking
from endoscope_explain.decide.given_physics import GivenJoints, GivenPhysics, without_recording
from endoscope_explain.fit.nominal import with_references
from endoscope_explain.fit.pooled import judged_alone
from endoscope_explain.observe.held_noise import with_held_noise
from endoscope_explain.observe.observation import observe
from endoscope_explain.pipeline import JointsDifferError, Sources, read_inputs
from endoscope_explain.search.levels import FALSE_ALARMS
from endoscope_explain.search.shared_choice import (
    ReferenceFits,
    SharedChoice,
    settled_together,
    with_one_more,
)

BEAM = 3
"""Choices of effects that are kept at each step (beam search)."""


def physics_of_all(
    sources: Sequence[Sources], jobs: int, tell: Callable[[str], None]
) -> list[GivenJoints]:
    """Read several recordings of a rig and choose the effects that explain all of them.

    Returns: for each recording.
    Raises BagError: if a recording cannot be used, or has other joints than the first one.
    """
    recordings: list[dict[str, ReferenceFits]] = []
    with threadpool_limits(1, 'blas'):
        for one in sources:
            inputs = read_inputs(one)
            recording = inputs.audit.recording
            tell(f'{recording.name}: refitting the nominal plant')
            _, references = with_references(
                recording,
                with_held_noise(observe(recording, inputs.plant)),
                inputs.plant,
                one.band,
                jobs,
            )
            joints = recording.joints
            if recordings and set(joints) != set(recordings[0]):
                raise JointsDifferError(
                    f'{one.bag}: has {", ".join(joints)}, but {sources[0].bag} has '
                    f'{", ".join(recordings[0])}'
                )
            recordings.append(dict(zip(joints, references, strict=True)))
        return shared_effects(recordings, sources[0].most_effects, jobs, tell)


def shared_effects(
    recordings: Sequence[Mapping[str, ReferenceFits]],
    most_effects: int,
    jobs: int,
    tell: Callable[[str], None],
) -> list[GivenJoints]:
    """Choose effects for all recordings of a rig together.

    `recordings`: nominal fits of each joint of each recording; see `search.refit.trial_fit`.
    `most_effects`: largest number of effects on a joint.
    Returns: for each recording; the effects are those of all, in the order in which they were
        added.
    """
    given: list[dict[str, GivenPhysics]] = [{} for _ in recordings]
    for joint in recordings[0]:
        nominal = SharedChoice(joint, (), tuple(references[joint] for references in recordings))
        chosen, _ = searched(nominal, most_effects, jobs, tell)
        alone = judged_alone([references[0] for references in chosen.recordings])
        for physics, found in zip(given, alone, strict=True):
            own = tuple(e for e in chosen.effects if found.model.flags[describe(e).flag])
            physics[joint] = without_recording(own, found)
    return list(given)


def searched(
    nominal: SharedChoice, most_effects: int, jobs: int, tell: Callable[[str], None]
) -> tuple[SharedChoice, SharedChoice | None]:
    """Add effects one by one to the best few choices: the best single effect may mislead.

    Returns `found`: with the effects that gain more than another form would.
    Returns `refused`: the best one with an effect more, if another form may gain as much.
    """
    best, beam = nominal, [nominal]
    most_effects += len(lacking(nominal.recordings[0][0].model.base))
    while len(best.effects) < most_effects:
        if best.leaves_noise():
            tell(f'{nominal.joint}: only noise is left beside {_listed(best)}')
            break
        grown: dict[frozenset[str], SharedChoice] = {}
        for choice in beam:
            tell(f'{nominal.joint}: what all recordings lack beside {_listed(choice)}')
            for found in with_one_more(choice, jobs):
                key = frozenset(found.effects)
                grown[key] = max(found, grown.get(key, found), key=SharedChoice.total)
        chosen = sorted(grown.values(), key=SharedChoice.total, reverse=True)[:BEAM]
        beam = settled_together(chosen, jobs)
        if not beam:
            break
        gain = best.gain_of(beam[0])
        shown, null = best.null(jobs)
        chance = null.p_value(shown)
        if chance > FALSE_ALARMS:
            tell(
                f'{nominal.joint}: not {_listed(beam[0])}: better by {gain:.0f} nats, but '
                f'{chance:.1%} of rigs without it show as much'
            )
            return best, beam[0]
        tell(f'{nominal.joint}: {_listed(beam[0])}, better by {gain:.0f} nats')
        best = beam[0]
    return best, None


def _listed(choice: SharedChoice) -> str:
    return ', '.join(choice.effects) or 'nothing'
