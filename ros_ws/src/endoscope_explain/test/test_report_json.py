"""report.json to the letter of its description."""

import dataclasses
import json
import math

import numpy as np
import pytest

from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.plant_file import load_plant
from endoscope_core.rig import Kind
from endoscope_core.signals.sampled_motion import read_command_file
from endoscope_explain.audit import AuditReport, Finding, Severity
from endoscope_explain.case import NextExperiment, combined_effects, combined_verdict
from endoscope_explain.explanation import Estimate, NominalEstimate, Verdict
from endoscope_explain.report.writing import KEYS, report_mapping, write_report

EFFECT = {'id', 'joint', 'stage', 'equation', 'source', 'parameters', 'probability'}
EFFECT |= {'alternatives', 'evidence', 'left_open'}
STAGES = {'actuator', 'transmission', 'joint', 'sensing', 'recording'}


def check_report(report):
    assert list(report) == list(KEYS)
    assert report['schema'] == 1
    assert report['verdict'] in set(Verdict)
    assert set(report['rig']) == {'kind', 'program', 'rig_sha256', 'plant', 'plant_sha256'}
    assert report['rig']['kind'] in set(Kind)
    for place in report['where']:
        assert set(place) == {'stage', 'joint', 'signals', 'intervals', 'regime', 'band_hz'}
        assert place['stage'] in STAGES
        assert place['signals']
        assert all('/' in s for s in place['signals'])
        assert all(a <= b for a, b in place['intervals'])
        assert place['regime']
        low, high = place['band_hz']
        assert 0 <= low <= high
    for effect in report['effects']:
        assert set(effect) == EFFECT
        assert effect['stage'] in STAGES
        # It was measured of names that the search gives, not of what an audit finds.
        searched = 'margin' in effect['evidence']
        assert (effect['probability'] is not None) == searched
        if searched:
            assert 0.0 < effect['probability'] < 1.0
            assert effect['evidence']['margin'] >= 0
        assert effect['equation']
        assert effect['source']
        for estimate in effect['parameters'].values():
            assert set(estimate) == {'value', 'low', 'high', 'unit'}
            assert estimate['low'] <= estimate['value'] <= estimate['high']
        definition = CATALOGUE.get(effect['id'])
        if definition is not None:
            wanted = {p.name for p in definition.parameters if p.comparable}
            assert wanted <= set(effect['parameters'])
    for joint in report['parameters'].values():
        for estimate in joint.values():
            assert {'nominal', 'value', 'low', 'high'} <= set(estimate)
    assert {'nominal', 'refitted', 'augmented'} <= set(report['fit'])
    for fits in ('nominal', 'refitted', 'augmented'):
        for fit in report['fit'][fits].values():
            assert fit['rmse_over_noise'] == pytest.approx(fit['rmse'] / fit['noise'])
    symbolic = report['symbolic']
    assert symbolic is None or symbolic['expression']
    experiment = report['next_experiment']
    assert experiment is None or set(experiment) == {'why', 'separates', 'command'}
    check_finite(report)


def check_finite(value):
    if isinstance(value, dict):
        for item in value.values():
            check_finite(item)
    elif isinstance(value, list):
        for item in value:
            check_finite(item)
    elif isinstance(value, float):
        assert math.isfinite(value)


def test_a_report_has_the_form_that_is_promised(stribeck_case):
    report = report_mapping(stribeck_case)
    check_report(json.loads(json.dumps(report, allow_nan=False)))
    assert report['verdict'] == 'missing_physics'
    assert report['where'][0]['stage'] == 'transmission'
    augmented, nominal = report['fit']['augmented'], report['fit']['nominal']
    wire = 'wires/measured_js:wire_x_pos'
    assert augmented[wire]['rmse'] < 0.5 * nominal[wire]['rmse']


def test_an_open_interval_ends_at_the_parameters_bound(stribeck_case):
    effect = stribeck_case.effects[0]
    open_ended = dataclasses.replace(effect.parameters['rise'], high=math.inf)
    changed = dataclasses.replace(effect, parameters={**effect.parameters, 'rise': open_ended})
    report = report_mapping(dataclasses.replace(stribeck_case, effects=(changed,)))
    bound = next(p.high for p in CATALOGUE['stribeck_friction'].parameters if p.name == 'rise')
    assert report['effects'][0]['parameters']['rise']['high'] == bound


def test_what_chooses_a_form_is_no_parameter(stribeck_case):
    effect = stribeck_case.effects[0]
    tail = Estimate(1.0, 1.0, 1.0, '-')
    changed = dataclasses.replace(effect, parameters={**effect.parameters, 'tail': tail})
    report = report_mapping(dataclasses.replace(stribeck_case, effects=(changed,)))
    assert set(report['effects'][0]['parameters']) == {'rise', 'stribeck_speed'}


@pytest.mark.parametrize(('band', 'inside'), [(0.15, False), (0.2, True)])
def test_the_tolerance_is_the_one_that_was_asked_for(stribeck_case, band, inside):
    estimate = NominalEstimate(5.9, 5.8, 6.0, 'N', 5.0, False)
    explanation = dataclasses.replace(
        stribeck_case.explanation, parameters={'bend_x': {'pretension': estimate}}
    )
    asked = dataclasses.replace(stribeck_case.inputs.sources, band=band)
    inputs = dataclasses.replace(stribeck_case.inputs, sources=asked)
    case = dataclasses.replace(stribeck_case, explanation=explanation, inputs=inputs)
    assert report_mapping(case)['parameters']['bend_x']['pretension']['in_band'] is inside


def test_unknown_physics_carries_its_formula(stribeck_case, missing_function):
    explanation = dataclasses.replace(
        stribeck_case.explanation, verdict=Verdict.UNKNOWN_PHYSICS, unknown=missing_function
    )
    case = dataclasses.replace(
        stribeck_case, explanation=explanation, verdict=Verdict.UNKNOWN_PHYSICS
    )
    report = report_mapping(case)
    check_report(report)
    assert report['symbolic']['expression'] == missing_function.expression
    assert report['symbolic']['place'] == 'load_of_angle'
    assert len(report['symbolic']['function']['value']) == 41
    assert report['symbolic']['siblings'] == ['gravity']


@pytest.mark.parametrize('joints', [('bend_x', 'bend_y'), ('bend_x',), ('bend_y',)])
def test_the_written_plant_holds_the_effect_and_the_motion_is_beside_it(
    stribeck_case, tmp_path, joints
):
    experiment = NextExperiment(
        'two rivals',
        ('viscous_friction', 'stribeck_friction'),
        'slow ramps',
        'bend_x',
        {'slow ramps': 4.0},
        (0.0, 0.5, 1.0),
        tuple((angle,) * len(joints) for angle in (0.0, 0.2, 0.0)),
        joints,
    )
    write_report(dataclasses.replace(stribeck_case, next_experiment=experiment), tmp_path)
    report = json.loads((tmp_path / 'report.json').read_text())
    check_report(report)
    assert load_plant(tmp_path / 'plant.yaml') == stribeck_case.plant
    table = read_command_file(tmp_path / report['next_experiment']['command']['file'])
    np.testing.assert_allclose(table.time, experiment.time)
    for joint, angle in zip(table.joints, table.angle.T, strict=True):
        np.testing.assert_allclose(angle, (0.0, 0.2, 0.0) if joint in joints else 0.0)


def finding(effect_id, stage):
    return Finding(
        effect_id,
        Severity.FAULT,
        'bend_x',
        stage,
        ('slave/measured_js',),
        ((1.0, 2.0),),
        'text',
        'remedy',
        parameters={'time_s': Estimate(1.0, 0.9, 1.1, 's')},
    )


@pytest.mark.parametrize(
    ('findings', 'effects', 'verdict'),
    [
        ([('recording_gap', 'recording')], True, 'missing_physics'),
        ([('recording_gap', 'recording')], False, 'recording_fault'),
        ([('tracker_outliers', 'sensing')], False, 'sensor_fault'),
        ([('held_samples', 'recording')], False, 'recording_fault'),
        ([], False, 'consistent'),
    ],
)
def test_the_audits_faults_enter_the_verdict(stribeck_case, findings, effects, verdict):
    explanation = stribeck_case.explanation
    if not effects:
        explanation = dataclasses.replace(explanation, effects=(), verdict=Verdict.CONSISTENT)
    audit = AuditReport(stribeck_case.recording, tuple(finding(*f) for f in findings))
    assert combined_verdict(explanation, audit) == verdict
    named = {e.id for e in combined_effects(explanation, audit)}
    assert named == ({'stribeck_friction'} if effects else set()) | (
        {f for f, _ in findings} & set(CATALOGUE)
    )
