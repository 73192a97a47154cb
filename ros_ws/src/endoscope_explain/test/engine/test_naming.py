import numpy as np
import pytest
from explained_corpus import CORPUS, LAW

from endoscope_core.physics.description import EffectSpec
from endoscope_core.physics.functions.term import evaluate
from endoscope_core.physics.simulator import simulate
from endoscope_core.rig import shipped_rig
from endoscope_explain.explain_recording import explain_recording
from endoscope_explain.explanation import Verdict

OTHER = {'wire_stiffness': 3300.0, 'capstan_exponent': 0.83, 'joint_friction': 8.2e-4}


def test_other_parameters_are_found_and_no_effect_is_named(corpus):
    explanation = corpus.case('other_numbers').explanation
    assert explanation.verdict is Verdict.PARAMETERS_DIFFER
    assert explanation.effects == ()
    for name in ('wire_stiffness', 'capstan_exponent'):
        value = getattr(CORPUS['other_numbers'].rig.joints['bend_x'], name)
        estimate = explanation.parameters['bend_x'][name]
        assert estimate.value == pytest.approx(value, rel=0.02)
        assert estimate.low <= estimate.value <= estimate.high
        assert estimate.in_band


@pytest.mark.nightly
def test_an_effect_is_found_beside_a_number_far_from_its_description(one_joint):
    true = one_joint.rig(
        EffectSpec('tracker_delay', 'bend_x', {'delay_s': 0.05}), wire_stiffness=2000.0
    )
    explanation = explain_recording(
        one_joint.record(true, one_joint.motion(7.0)), one_joint.rig(), jobs=2
    )
    assert explanation.verdict is Verdict.SENSOR_FAULT
    (named,) = explanation.effects
    assert named.id == 'tracker_delay'
    assert named.evidence['margin'] > 10.0
    assert named.parameters['delay_s'].value == pytest.approx(0.05, rel=0.05)
    estimate = explanation.parameters['bend_x']['wire_stiffness']
    assert estimate.value == pytest.approx(2000.0, rel=0.02)
    assert not estimate.in_band
    (spec,) = explanation.augmented.effects
    assert spec.id == 'tracker_delay'
    worst = max(fit.ratio for fit in explanation.fit['augmented'].values())
    assert worst < 1.3 < max(fit.ratio for fit in explanation.fit['refitted'].values())
    assert explanation.adequate


def test_a_law_of_no_known_form_is_a_function_at_its_place(corpus):
    true, explanation = CORPUS['unknown'].rig, corpus.case('unknown').explanation
    assert explanation.verdict is Verdict.UNKNOWN_PHYSICS
    unknown = explanation.unknown
    assert unknown.place == 'exponent_of_angle'
    assert unknown.explained > 0.95
    inner = slice(len(unknown.nodes) // 8, -len(unknown.nodes) // 8)
    expected = evaluate(LAW.expression, unknown.there.argument.symbol, unknown.nodes[inner])
    assert np.corrcoef(unknown.values[inner], expected)[0, 1] > 0.95
    time = 1e-3 * np.arange(6000)
    other = shipped_rig().joints.gear * (0.9 * np.sin(1.7 * time) + 0.3 * np.sin(4.1 * time))
    plants = (true, explanation.augmented, explanation.refitted)
    answers = [simulate(each, other[:, None]).bending for each in plants]
    with_term, without = (np.sqrt(np.mean((answers[0] - a) ** 2)) for a in answers[1:])
    assert with_term < 0.3 * without


@pytest.mark.nightly
def test_what_was_there_in_health_is_not_explained_again(one_joint):
    healthy = one_joint.rig(EffectSpec('gravity', 'bend_x', {'moment_nm': 0.0003}), **OTHER)
    bias = EffectSpec('tracker_bias', 'bend_x', {'bias_rad': 0.05})
    worn = one_joint.rig(*healthy.effects, bias, **OTHER)
    command = one_joint.motion(6.0)
    explanation = explain_recording(
        one_joint.record(worn, command, 1),
        one_joint.rig(),
        baseline=one_joint.record(healthy, command, 2),
        jobs=2,
    )
    assert [e.id for e in explanation.effects] == ['tracker_bias']
    assert explanation.effects[0].parameters['bias_rad'].value == pytest.approx(0.05, rel=0.1)


def test_a_rig_that_was_not_moved_cannot_be_explained(one_joint):
    explanation = explain_recording(
        one_joint.record(one_joint.rig(), np.zeros(3000)), one_joint.rig(), jobs=2
    )
    assert explanation.verdict is Verdict.INSUFFICIENT_DATA
