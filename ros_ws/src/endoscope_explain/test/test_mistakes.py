"""A mistake is said before anything is fitted, and what looks like one is not."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_explain.audit import audit_recording
from endoscope_explain.explanation import Verdict
from endoscope_explain.pipeline import Inputs, Sources, explain_case
from endoscope_explain.report.writing import write_report


def inputs(plant, audit):
    return Inputs(Sources(Path('rig'), plant), audit)


def never(*_, **__):
    raise AssertionError('a misread recording was fitted')


def test_the_readings_are_handed_on_as_they_must_be_meant(record):
    sound = record()
    degrees = replace(sound.bending, values=np.degrees(sound.bending.values))
    audit = audit_recording(sound.with_series({'bending': degrees}), PlantDescription())
    np.testing.assert_allclose(audit.recording.bending.values, sound.bending.values)


def test_plugs_that_were_exchanged_are_at_the_sensors(record):
    sound = record()
    swapped = replace(sound.tension, values=sound.tension.values[:, ::-1])
    plant = PlantDescription()
    audit = audit_recording(sound.with_series({'tension': swapped}), plant)
    case = explain_case(inputs(plant, audit), never)
    assert case.verdict is Verdict.RECORDING_FAULT
    assert {place.stage for place in case.places} == {'sensing'}


def test_forces_of_another_rig_are_no_counts_of_a_converter(record):
    own = JointParameters()
    thrice = {n: 3.0 * getattr(own, n) for n in ('pretension', 'wire_stiffness', 'joint_stiffness')}
    plant = PlantDescription(joints={'bend_x': own})
    other = record(PlantDescription(joints={'bend_x': replace(own, **thrice)}))
    assert not audit_recording(other, plant).faults()
    counts = replace(other.tension, values=2.0 * other.tension.values)
    (finding,) = audit_recording(other.with_series({'tension': counts}), plant).faults()
    assert 'counts of a converter' in finding.text


def test_a_pause_that_ends_at_another_pose_is_no_gap(record):
    """A console that was let go begins anew where the rig is, not where it commanded last."""
    sound = record()
    command = sound.command
    begin = int(np.searchsorted(command.time, 5.0))
    end = begin + 2000
    held = {}
    for name, series in {'command': command, **sound.measured()}.items():
        since = int(np.searchsorted(series.time, 4.0))
        until = int(np.searchsorted(series.time, 7.0))
        values = series.values.copy()
        if name in ('shaft_position', 'command'):
            values[since:until] = values[since]
        held[name] = replace(series, values=values)
    times = np.r_[:begin, end : len(command.time)]
    held['command'] = held['command'].taken(times)
    audit = audit_recording(sound.with_series(held), PlantDescription())
    assert 'recording_gap' not in {f.id for f in audit.findings}


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
    case = explain_case(inputs(plant, audit), jobs=1)
    assert case.verdict is Verdict.INSUFFICIENT_DATA
    write_report(case, tmp_path)
    assert 'The recording cannot tell' in (tmp_path / 'report.html').read_text()
