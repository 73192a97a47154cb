"""Several recordings of one rig as one: the rig goes on, and so does what it remembers."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from endoscope_bags.errors import BagError
from endoscope_core.physics.description import EffectSpec, JointParameters, PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_explain.audit import audit_recording
from endoscope_explain.audit.finding import AuditReport, Finding, Severity
from endoscope_explain.case import Inputs, Sources
from endoscope_explain.observe.observation import observe
from endoscope_explain.observe.predicted_signals import fits_by, simulate_rig, view
from endoscope_explain.takes import inputs_joined, recordings_joined

GEAR = shipped_rig().joints.gear
RIG = PlantDescription()
FIRST, REST, SECOND = 6.0, 2.0, 5.0


def shaft():
    """Commands of two motions with a rest between them; both joints move."""
    parts = []
    for seconds, rate in ((FIRST, 1.3), (SECOND, 2.1)):
        time = np.arange(0.0, seconds, 1e-3)
        window = np.sin(np.pi * time / seconds)[:, None] ** 2
        parts.append(window * np.sin(np.outer(time, [rate, 1.7 * rate])))
    return GEAR * 0.8 * np.concatenate([parts[0], np.zeros((round(REST / 1e-3), 2)), parts[1]])


def part_of(recording, begin, end, name):
    """What was recorded from `begin` to `end` s, as a recording of its own would have it."""
    every = {'command': recording.command, **recording.measured()}
    cut = {}
    for key, series in every.items():
        inside = (series.time >= begin - 1e-9) & (series.time < end - 1e-9)
        kept = series.taken(inside)
        cut[key] = dataclasses.replace(kept, time=kept.time - begin)
    return dataclasses.replace(recording, name=name, **cut)


@pytest.fixture(scope='module')
def whole(record):
    command = shaft()
    return record(RIG, len(command) * 1e-3, 3, command)


@pytest.fixture(scope='module')
def takes(whole):
    begin = FIRST + REST
    return part_of(whole, 0.0, FIRST, 'one'), part_of(whole, begin, begin + SECOND, 'two')


def test_the_rig_itself_leaves_noise_of_both(takes):
    joined = recordings_joined(takes)
    fits = fits_by(view(joined, {'rig': RIG}), 'rig')
    assert max(fit.ratio for fit in fits.values()) < 1.1
    # Without what the first motion has left behind, the second one is another one.
    alone = fits_by(view(takes[1], {'rig': RIG}), 'rig')
    assert max(fit.ratio for fit in alone.values()) > 2.0


@pytest.fixture(scope='module')
def described():
    """The rig as somebody describes it who is not right."""
    numbers = JointParameters()
    stiffer = dataclasses.replace(
        numbers, joint_stiffness=1.1 * numbers.joint_stiffness, pretension=1.1 * numbers.pretension
    )
    return PlantDescription(dict.fromkeys(RIG.joints, stiffer))


def test_the_second_motion_begins_where_the_first_has_left_the_rig(takes, described):
    first = AuditReport(takes[0], ())
    alone = audit_recording(takes[1], described)
    after = audit_recording(takes[1], described, first)
    assert 'earlier_motion' in {finding.id for finding in alone.findings}
    assert 'earlier_motion' not in {finding.id for finding in after.findings}

    def left(second):
        joined = recordings_joined((takes[0], second.recording))
        return max(fit.ratio for fit in fits_by(view(joined, {'rig': RIG}), 'rig').values())

    # By a plant that is not right, the second one alone has a past that the rig has never had.
    assert left(after) < 1.1 < 2.0 < left(alone)


def test_what_presses_on_a_rig_goes_on_pressing(record):
    loaded = dataclasses.replace(
        RIG, effects=(EffectSpec('external_load', 'bend_x', {'moment_nm': 0.001, 'time_s': 1.0}),)
    )
    command = shaft()
    whole = record(loaded, len(command) * 1e-3, 3, command)
    begin = FIRST + REST
    parts = part_of(whole, 0.0, FIRST, 'one'), part_of(whole, begin, begin + SECOND, 'two')
    fits = fits_by(view(recordings_joined(parts), {'rig': loaded}), 'rig')
    assert max(fit.ratio for fit in fits.values()) < 1.1


@pytest.mark.nightly
def test_a_rig_that_was_moved_between_two_motions_is_taken_to_have_a_past(whole, takes, described):
    first = AuditReport(takes[0], ())
    begin = FIRST + REST + 2.0
    later = part_of(whole, begin, begin + 3.0, 'later')
    after = audit_recording(later, described, first)
    assert 'earlier_motion' in {finding.id for finding in after.findings}


def test_coarse_ticks_begin_where_a_recording_does(takes):
    observations = observe(recordings_joined(takes), RIG)
    fine = simulate_rig(observations, RIG)[:, ::10]
    coarse = simulate_rig([o.coarser(10) for o in observations], RIG)
    (restart,) = observations[0].coarser(10).restarts
    assert restart.tick * 10 == observations[0].restarts[0].tick
    after = slice(restart.tick, fine.shape[1] - 10)
    assert np.abs(coarse[:, after, -1] - fine[:, after, -1]).max() < 0.02


def test_every_sample_is_kept_and_none_is_moved_within_its_recording(takes):
    joined = recordings_joined(takes)
    count = len(takes[0].bending.time)
    assert len(joined.bending.time) == count + len(takes[1].bending.time)
    apart = joined.bending.time[count:] - takes[1].bending.time
    assert np.ptp(apart) < 1e-9
    assert joined.restarts[0].time == pytest.approx(joined.command.time[0] + round(apart[0]))
    assert joined.restarts[0].time >= takes[0].duration + 1.0


def test_a_series_that_one_lacks_is_left_out(takes):
    without = dataclasses.replace(takes[1], tension=None)
    assert recordings_joined((takes[0], without)).tension is None


def inputs(recording, *findings):
    return Inputs(Sources(Path(recording.name), RIG), AuditReport(recording, findings))


def test_what_is_wrong_with_both_is_said_once_and_where(takes):
    found = Finding(
        'recording_gap', Severity.FAULT, 'bend_x', 'recording', (), ((1.0, 2.0),), 'a gap', 'none'
    )
    other = dataclasses.replace(found, id='held_samples')
    joined = inputs_joined([inputs(takes[0], found), inputs(takes[1], found, other)])
    assert [f.text for f in joined.audit.findings] == ['one: a gap', 'two: a gap']
    later = joined.audit.recording.restarts[0].time
    assert joined.audit.findings[1].intervals == ((1.0 + later, 2.0 + later),)


def test_other_joints_are_refused(takes, record):
    alone = record(PlantDescription({'bend_x': JointParameters()}), 3.0)
    with pytest.raises(BagError, match='has bend_x, but one has bend_x, bend_y'):
        inputs_joined([inputs(takes[0]), inputs(dataclasses.replace(alone, name='alone'))])
