"""Which effects explain several recordings of one rig best together; see `search.levels`."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from endoscope_explain.case import Sources
from endoscope_explain.decide.decision import found_together
from endoscope_explain.decide.given_physics import (
    GivenJoints,
    GivenPhysics,
    Rivalry,
    without_recording,
)
from endoscope_explain.fit.nominal import ReferenceFits, with_references
from endoscope_explain.fit.pooled import judged_alone
from endoscope_explain.observe.observation import observe, with_held_noise
from endoscope_explain.pipeline import read_inputs, refuse_other_joints
from endoscope_explain.search.levels import search


def physics_of_all(sources: Sequence[Sources], report: Callable[[str], None]) -> list[GivenJoints]:
    """Effects that explain all recordings of a rig; BagError if one cannot be used."""
    recordings: list[dict[str, ReferenceFits]] = []
    most_effects, first_bag = 0, Path()
    with threadpool_limits(1, 'blas'):
        for of in sources:
            one = read_inputs(of)
            recording = one.audit.recording
            if recordings:
                refuse_other_joints(of.bag, recording.joints, first_bag, recordings[0])
            else:
                most_effects, first_bag = of.effects, of.bag
            report(f'{recording.name}: refitting the nominal plant')
            _, references = with_references(
                recording,
                with_held_noise(observe(recording, one.plant)),
                one.plant,
                of.band,
                of.jobs,
            )
            recordings.append(dict(zip(recording.joints, references, strict=True)))
        return shared_effects(recordings, most_effects, sources[0].jobs, report)


def shared_effects(
    recordings: Sequence[Mapping[str, ReferenceFits]],
    most_effects: int,
    jobs: int,
    report: Callable[[str], None],
) -> list[GivenJoints]:
    """Choose effects for all recordings of a rig by the nominal fits of each joint."""
    given: list[dict[str, GivenPhysics]] = [{} for _ in recordings]
    for joint in recordings[0]:
        report(f'searching what {joint} lacks in all recordings')
        references = [of_joint[joint] for of_joint in recordings]
        tried = search(references, jobs, most_effects, report=report)
        found = tried.found
        rivalries = {
            term.term.id: Rivalry(term.name, term.contest, term.margin)
            for term in found_together(tried, jobs)
        }
        for physics, own in zip(given, judged_alone(found.fits), strict=True):
            # A recording that has no use for a term lacks it.
            there = tuple(t for t in found.terms if own.model.flags[t.effect.flag])
            physics[joint] = without_recording(there, own, rivalries)
    return list(given)
