"""A mistake is said and put right before all is fitted, and what looks like one is not said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_explain.audit import audit_recording
from endoscope_explain.case import Inputs, Sources
from endoscope_explain.explanation import Explanation, Verdict
from endoscope_explain.observe.predicted_signals import fits_by, view
from endoscope_explain.pipeline import explain_case
from endoscope_explain.report.html_page import html_page
from endoscope_explain.report.sentences import terminal_text
from endoscope_explain.report.writing import write_report

ONE_JOINT = PlantDescription(joints={'bend_x': JointParameters()})


def inputs(plant, audit):
    return Inputs(Sources(Path('rig'), plant, quick=True, effects=1, jobs=1), audit)


def standing(*quantities, since=0):
    def change(recording):
        series = {q: recording.measured()[q] for q in quantities}
        stood = {q: s.values.copy() for q, s in series.items()}
        for values in stood.values():
            values[since:] = values[since]
        return recording.with_series({q: replace(s, values=stood[q]) for q, s in series.items()})

    return change


def in_degrees(recording):
    bending = recording.bending
    return recording.with_series({'bending': replace(bending, values=np.degrees(bending.values))})


def test_a_command_in_degrees_is_known_by_the_reach_of_the_rig_where_only_the_tip_was_measured(
    record,
):
    sound = replace(record(duration=6.0), tension=None, shaft_position=None, shaft_velocity=None)
    sound = replace(sound, shaft_effort=None)
    assert audit_recording(sound, PlantDescription()).mistakes() == ()
    command = replace(sound.command, values=np.degrees(sound.command.values))
    audit = audit_recording(sound.with_series({'command': command}), PlantDescription())
    (mistake,) = audit.mistakes()
    assert mistake.text.startswith('motor/servo_jp:motor_x and motor/servo_jp:motor_y are 57.3 ')
    np.testing.assert_allclose(audit.recording.command.values, sound.command.values)


def test_units_are_those_of_another_recording_of_the_same_set_up(record):
    time = np.arange(0.0, 4.0, 1e-3)
    small = record(ONE_JOINT, command=(0.5 * np.sin(2.0 * time))[:, None])
    wide = record(ONE_JOINT, duration=6.0)
    known = audit_recording(in_degrees(wide), ONE_JOINT)
    audit = audit_recording(in_degrees(small), ONE_JOINT, known)
    np.testing.assert_allclose(audit.recording.bending.values, small.bending.values)
    assert audit.misreadings == known.misreadings
    # And of what a recording does not have nothing is corrected.
    without = replace(small, tension=None)
    in_mn = wide.with_series({'tension': replace(wide.tension, values=1e3 * wide.tension.values)})
    assert audit_recording(without, ONE_JOINT, audit_recording(in_mn, ONE_JOINT)).mistakes() == ()
    # Nobody changes a unit between two motions.
    audit = audit_recording(in_degrees(small), ONE_JOINT, audit_recording(wide, ONE_JOINT))
    assert audit.mistakes() == ()


def as_described(recording, plant, **_):
    """What is found where the plant is as described."""
    fit = fits_by(view(recording, {'nominal': plant}), 'nominal')
    plants = dict.fromkeys(('nominal', 'refitted', 'augmented'), plant)
    return Explanation(
        verdict=Verdict.CONSISTENT,
        effects=(),
        parameters={},
        fit=dict.fromkeys(plants, fit),
        **plants,
    )


@pytest.mark.parametrize(
    ('change', 'sentence', 'lost'),
    [
        (in_degrees, 'slave/measured_js:bend_x is 57.3 times', set()),
        pytest.param(
            standing('bending'),
            'slave/measured_js is frozen',
            {'slave/measured_js:bend_x'},
            marks=pytest.mark.nightly,
        ),
        (standing('tension', since=3000), 'wires/measured_js is frozen', set()),
        pytest.param(
            standing('shaft_position', 'shaft_velocity', 'shaft_effort'),
            'motor/measured_js is frozen',
            {'motor/measured_js:motor_x.position', 'motor/measured_js:motor_x.effort'},
            marks=pytest.mark.nightly,
        ),
    ],
)
def test_what_is_left_of_a_mistaken_recording_is_explained_below_the_mistake(
    record, change, sentence, lost
):
    sound = record(ONE_JOINT, duration=8.0)
    right, mistaken = (
        explain_case(inputs(ONE_JOINT, audit_recording(recording, ONE_JOINT)), as_described)
        for recording in (sound, change(sound))
    )
    assert (mistaken.verdict, mistaken.rest) == (Verdict.RECORDING_FAULT, Verdict.CONSISTENT)
    fit, of_right = mistaken.explanation.fit['refitted'], right.explanation.fit['refitted']
    assert set(of_right) - set(fit) == lost
    assert all(fit[signal].ratio < 1.2 for signal in fit)
    first, second, *_ = terminal_text(mistaken).splitlines()
    assert first.startswith(sentence)
    assert second.endswith(': The described plant predicts the recording of bend_x.')
    page = html_page(mistaken)
    assert first in page
    assert second in page


def test_what_no_unit_makes_fit_is_fitted_as_recorded_and_that_is_said(record):
    sound = record(ONE_JOINT, duration=6.0)
    bending = sound.bending
    shaken = 0.3 * np.sin(2.0 * np.pi * 3.0 * bending.time)[:, None]
    foreign = sound.with_series({'bending': replace(bending, values=shaken)})
    assert 'unlike_the_plant' not in {f.id for f in audit_recording(sound, ONE_JOINT).findings}
    audit = audit_recording(foreign, ONE_JOINT)
    assert audit.mistakes() == ()
    (note,) = [f for f in audit.findings if f.id == 'unlike_the_plant']
    assert note.signals == ('slave/measured_js:bend_x',)
    np.testing.assert_array_equal(audit.recording.bending.values, shaken)


def test_forces_of_another_rig_are_no_counts_of_a_converter(record):
    own = JointParameters()
    thrice = {n: 3.0 * getattr(own, n) for n in ('pretension', 'wire_stiffness', 'joint_stiffness')}
    plant = PlantDescription(joints={'bend_x': own})
    other = record(PlantDescription(joints={'bend_x': replace(own, **thrice)}))
    assert not audit_recording(other, plant).faults()
    counts = replace(other.tension, values=2.0 * other.tension.values)
    (finding,) = audit_recording(other.with_series({'tension': counts}), plant).faults()
    assert 'counts of a converter' in finding.text


@pytest.mark.engine
def test_where_nothing_moves_a_report_says_that_there_is_too_little(record, tmp_path):
    sound = record()
    still = {
        name: series.taken(np.zeros(len(series.time), int))
        for name, series in {'command': sound.command, **sound.measured()}.items()
    }
    every = {'command': sound.command, **sound.measured()}
    still = {name: replace(s, time=every[name].time) for name, s in still.items()}
    plant = PlantDescription()
    audit = audit_recording(sound.with_series(still), plant)
    case = explain_case(inputs(plant, audit))
    assert case.verdict is Verdict.INSUFFICIENT_DATA
    write_report(case, tmp_path)
    assert 'The recording cannot decide' in (tmp_path / 'report.html').read_text()
