"""What a rig had done before its recording began, and what is not judged for that."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.physics.description import PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_explain.audit import audit_recording
from endoscope_explain.observe.predicted_signals import view

PLANT = PlantDescription()
TIME = np.arange(0.0, 14.0, 1e-3)
SWEEP = 0.9 * np.sin(1.3 * TIME)


def since(recording, begin):
    """A recording that began later."""
    later = {}
    for name, series in {'command': recording.command, **recording.measured()}.items():
        kept = series.taken(series.time >= begin)
        later[name] = replace(kept, time=kept.time - begin)
    return recording.with_series(later)


def worst(recording):
    """Largest misfit of any signal with the plant as described, in units of its noise."""
    seen = view(recording, {'described': PLANT})
    return max(
        float(np.sqrt(np.mean(signal.residual('described') ** 2)))
        for signal in seen.signals.values()
    )


def moved(record, angle):
    command = shipped_rig().joints.gear * np.stack([angle, -0.7 * angle], axis=1)
    return record(duration=len(command) * 1e-3, command=command)


@pytest.mark.parametrize('begin', [pytest.param(3.1, marks=pytest.mark.nightly), 5.0])
def test_a_rig_that_moved_before_is_not_judged_by_what_is_not_known(record, begin):
    recording = since(moved(record, SWEEP), begin)
    assert worst(recording) > 2.0
    audit = audit_recording(recording, PLANT)
    assert {(f.id, f.joint, str(f.severity)) for f in audit.findings} == {
        ('earlier_motion', 'bend_x', 'note'),
        ('earlier_motion', 'bend_y', 'note'),
    }
    assert worst(audit.recording) < 1.15
    told = audit.findings[0]
    assert told.remedy == f'what is before {told.intervals[0][1]:.2f} s is not judged'
    early = recording.tension.time < told.intervals[0][1]
    column = recording.joints.index(told.joint)
    assert not audit.recording.tension.valid[early, column].any()
    assert audit.recording.tension.valid[~early, column].all()


def test_where_nothing_would_be_left_the_state_is_estimated(record):
    # The motion is too small ever to wipe out what came before.
    angle = np.where(TIME < 7.0, SWEEP, SWEEP[7000] + 0.1 * np.sin(2.0 * (TIME - 7.0)))
    recording = since(moved(record, angle), 7.5)
    before = worst(recording)
    audit = audit_recording(recording, PLANT)
    assert worst(audit.recording) < 1.3 < 5.0 < before
    assert {f.remedy for f in audit.findings} == {
        'the state at the start is estimated, and all is judged from it'
    }


def test_a_rig_that_comes_from_zero_is_judged_from_the_beginning(record):
    recording = moved(record, SWEEP)
    audit = audit_recording(recording, PLANT)
    assert audit.findings == ()
    assert audit.recording.tension.valid.all()


@pytest.mark.nightly
def test_a_past_that_no_reversals_explain_is_left_out_though_little_is_left(record):
    # How fast the rig came is not estimated: the joint's damping keeps it from where it rests.
    angle = 0.6 * np.sin(9.0 * np.minimum(TIME, 3.1))
    angle = np.where(TIME < 6.0, angle, angle + 0.7 * np.sin(1.5 * (TIME - 6.0)))[:9400]
    command = shipped_rig().joints.gear * np.stack([angle, angle], axis=1)
    recording = since(record(duration=9.4, command=command), 4.0)
    audit = audit_recording(recording, PLANT)
    assert {f.remedy for f in audit.findings} == {'what is before 4.77 s is not judged'}
    assert worst(audit.recording) < 1.3 < 3.0 < worst(recording)


def test_by_how_little_a_servo_overshot_is_part_of_the_past(record):
    """Millionths of a rad relax the wire at the motor by more than its cell's noise."""
    angle = np.interp(TIME[:9000], [0.0, 2.0, 2.6, 4.0, 4.6, 7.0], [0.0, 0.0, -0.5, -0.5, 0.0, 0.0])
    angle[7000:] = 0.2 * np.sin(2.0 * (TIME[7000:9000] - 7.0))
    recording = since(moved(record, angle), 5.2)
    audit = audit_recording(recording, PLANT)
    assert worst(audit.recording) < 1.15 < 5.0 < worst(recording)
    for told in audit.findings:
        assert told.remedy == 'the state at the start is estimated, and all is judged from it'
        assert 0.0 < abs(told.evidence['reversal_2_rad']) < 1e-4


@pytest.mark.filterwarnings('error::RuntimeWarning')
def test_a_plant_far_from_the_rig_does_not_send_the_search_beyond_all_numbers(record):
    factors = {
        'pretension': 2.2,
        'wire_stiffness': 0.27,
        'pulley_radius': 0.14,
        'joint_radius': 0.35,
        'capstan_exponent': 3.15,
        'joint_stiffness': 2.91,
        'motor_bandwidth': 0.08,
        'motor_damping_ratio': 0.42,
    }
    joint = PLANT.joints['bend_x']
    wrong = replace(joint, **{name: f * getattr(joint, name) for name, f in factors.items()})
    plant = replace(PLANT, joints={**PLANT.joints, 'bend_x': wrong})
    audit = audit_recording(since(moved(record, SWEEP[:8000]), 3.1), plant)
    assert 'earlier_motion' in {f.id for f in audit.findings if f.joint == 'bend_x'}
