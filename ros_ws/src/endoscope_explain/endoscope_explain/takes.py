"""Several recordings of one rig: as one recording, or by one choice of effects for all of them.

Of motions made one after the other the rig is the same: one set of numbers has to explain them, and
the search of one recording serves. In other shapes only its effects are the same.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_explain.audit.finding import AuditReport
from endoscope_explain.case import Inputs, Sources
from endoscope_explain.decide.decision import (
    GivenJoints,
    GivenPhysics,
    Rivalry,
    found_together,
    without_recording,
)
from endoscope_explain.fit.nominal import ReferenceFits, with_references
from endoscope_explain.fit.pooled import judged_alone
from endoscope_explain.observe.observation import observe, with_held_noise
from endoscope_explain.pipeline import read_inputs, refuse_other_joints
from endoscope_explain.recording import MOVES_RAD, Array, Restart, RigRecording, Series
from endoscope_explain.search.levels import search

APART_S = 1.0
"""Least rest between two recordings; each begins whole seconds after the first one, so that ticks
of any length begin with it."""


def inputs_joined(inputs: Sequence[Inputs]) -> Inputs:
    """Recordings of one rig, read and audited, as one; BagError if one has other joints."""
    first = inputs[0]
    if len(inputs) == 1:
        return first
    recordings = [one.audit.recording for one in inputs]
    for one, recording in zip(inputs, recordings, strict=True):
        refuse_other_joints(
            one.sources.bag, recording.joints, first.sources.bag, recordings[0].joints
        )
    later = _later_by(recordings)
    findings = [
        replace(
            finding,
            text=f'{one.audit.recording.name}: {finding.text}',
            intervals=tuple((begin + by, end + by) for begin, end in finding.intervals),
        )
        for one, by in zip(inputs, later, strict=True)
        for finding in one.audit.findings
    ]
    # What is wrong with several of them is one fault.
    once = {(f.id, f.joint, f.signals): f for f in reversed(findings)}
    kept = tuple(f for f in findings if once[f.id, f.joint, f.signals] is f)
    return replace(first, audit=AuditReport(recordings_joined(recordings), kept))


def recordings_joined(recordings: Sequence[RigRecording]) -> RigRecording:
    """Recordings of the same joints one after the other, with the series that all of them have."""
    first = recordings[0]
    later = _later_by(recordings)
    measured = [recording.measured() for recording in recordings]
    series: dict[str, Any] = {
        name: _one_after_another([own[name] for own in measured], later)
        if all(name in own for own in measured)
        else None
        for name in measured[0]
    }
    return replace(
        first,
        name=', '.join(recording.name for recording in recordings),
        command=_one_after_another([recording.command for recording in recordings], later),
        notes=tuple(dict.fromkeys(note for one in recordings for note in one.notes)),
        restarts=tuple(
            Restart(
                float(one.command.time[0]) + by,
                _way_between(before, one) if one.start is None else one.start,
                np.zeros(len(one.joints)) if one.start_speed is None else one.start_speed,
            )
            for before, one, by in zip(recordings[:-1], recordings[1:], later[1:], strict=True)
        ),
        **series,
    )


def _way_between(before: RigRecording, one: RigRecording) -> Array:
    """The motors' way (J, K) from the end of one recording to the next: none where they stood."""
    first = one.command.values[0]
    stood = bool(np.all(np.abs(first - before.command.values[-1]) < MOVES_RAD))
    return np.empty((len(first), 0)) if stood else first[:, None]


def _later_by(recordings: Sequence[RigRecording]) -> list[float]:
    """By how much the times of each recording are later, in s, in all of them as one."""
    begin, later = float(recordings[0].command.time[0]), [0.0]
    for before, one in pairwise(recordings):
        over = before.duration + later[-1] + APART_S
        own = float(one.command.time[0])
        # No sample of it may come before its own first command's whole second.
        later.append(begin + math.ceil(over - begin + own) - own)
    return later


def _one_after_another(parts: Sequence[Series], later: Sequence[float]) -> Series:
    return Series(
        parts[0].topic,
        np.concatenate([part.time + by for part, by in zip(parts, later, strict=True)]),
        np.concatenate([part.values for part in parts]),
        np.concatenate([part.valid for part in parts]),
    )


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
