"""A name that a second recording does not confirm is said with its doubt, and not asserted."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_explain.case import Inputs, Sources
from endoscope_explain.compare import confirmed_by, ladders
from endoscope_explain.explanation import Verdict
from endoscope_explain.pipeline import explain_case
from endoscope_explain.report.html_page import html_page
from endoscope_explain.report.sentences import terminal_text
from endoscope_explain.report.writing import report_mapping

DOUBT = (
    'stribeck_friction or viscous_friction on bend_x fits this recording, but does not clearly '
    'predict the second one better; it may stand for something else.'
)


def motion(seconds=12.0):
    time = 1e-3 * np.arange(int(seconds / 1e-3))
    return 0.7 * shipped_rig().joints.gear * np.sin(np.outer(time, [0.9, 1.7]))


@pytest.fixture(scope='module')
def concealed(stribeck_case):
    """The effect that the first recording shows."""
    (effect,) = stribeck_case.explanation.augmented.effects
    return effect


@pytest.fixture(scope='module')
def explained(stribeck_case, record):
    """A function that explains the first recording, with a second one of a rig with effects."""

    def explained(*effects, **changed):
        second = record(PlantDescription(effects=effects), seed=3, command=motion())
        explanation = replace(stribeck_case.explanation, **changed)
        sources = Sources(Path('synthetic'), explanation.nominal, quick=True)
        inputs = Inputs(sources, stribeck_case.audit, validation=second)
        return explain_case(inputs, lambda *_, **__: explanation)

    return explained


def test_what_predicts_the_second_recording_better_is_asserted(explained, concealed):
    case = explained(concealed)
    assert case.effects[0].evidence['second_p_value'] < 0.01
    assert terminal_text(case).startswith('The simulation leaves out stribeck_friction')
    assert 'in doubt' not in html_page(case)


def test_what_does_not_is_named_in_doubt_everywhere(explained):
    case = explained()
    assert case.verdict is Verdict.MISSING_PHYSICS
    refitted, augmented = (case.validation[name] for name in ('refitted', 'augmented'))
    worst = max((s for s in refitted if '_x' in s), key=lambda s: refitted[s].ratio)
    assert augmented[worst].ratio > refitted[worst].ratio
    for text in (terminal_text(case), html_page(case)):
        assert DOUBT in text
        assert 'stribeck_friction (in doubt)' in text
        assert 'leaves out stribeck_friction' not in text
    (effect,) = report_mapping(case)['effects']
    assert effect['id'] == 'stribeck_friction'
    assert effect['evidence']['second_p_value'] > 0.5


def test_where_another_form_leaves_less_a_doubted_name_leaves_unknown_physics(explained, concealed):
    assert explained(adequate=False).verdict is Verdict.UNKNOWN_PHYSICS
    assert explained(concealed, adequate=False).verdict is Verdict.MISSING_PHYSICS


def test_a_second_recording_does_not_refute_what_acted_at_a_time_of_the_first(
    explained, stribeck_case
):
    load = replace(stribeck_case.effects[0], id='external_load', parameters={}, alternatives=())
    case = explained(adequate=False, effects=(load,))
    assert case.verdict is Verdict.MISSING_PHYSICS
    assert 'better; it acted in this one alone, or stands for something else.' in terminal_text(
        case
    )


def test_a_name_that_survives_is_asserted_beside_one_in_doubt(explained, concealed, stribeck_case):
    (first,) = stribeck_case.effects
    other = replace(first, id='gravity', joint='bend_y', parameters={}, alternatives=())
    case = explained(concealed, effects=(first, other), adequate=False)
    assert [effect.doubtful for effect in case.effects] == [False, True]
    assert case.verdict is Verdict.MISSING_PHYSICS
    first_line, *rest = terminal_text(case).splitlines()
    assert 'gravity' not in first_line
    assert any(line.startswith('gravity on bend_y fits this recording, but') for line in rest)


def test_a_stop_that_is_hit_once_in_the_second_recording_is_confirmed(record, stribeck_case):
    stop = EffectSpec('joint_stop', 'bend_x', {'angle_rad': 0.5})
    command = 0.4 * motion()
    command[9000:9800, 0] = 0.9 * np.sin(np.linspace(0.0, np.pi, 800))
    second = record(PlantDescription(effects=(stop,)), command=command)
    augmented = replace(stribeck_case.explanation.nominal, effects=(stop,))
    named = replace(stribeck_case.effects[0], id='joint_stop')
    explanation = replace(stribeck_case.explanation, augmented=augmented, effects=(named,))
    (effect,) = confirmed_by(second, explanation)
    assert not effect.doubtful


def test_a_delay_of_the_tracker_is_judged_on_all_joints_together(record, stribeck_case):
    late = tuple(EffectSpec('tracker_delay', j, {'delay_s': 0.15}) for j in ('bend_x', 'bend_y'))
    second = record(PlantDescription(effects=late), command=motion() * [1.0, 0.05])
    augmented = replace(stribeck_case.explanation.nominal, effects=late)
    named = tuple(
        replace(stribeck_case.effects[0], id='tracker_delay', joint=spec.joint) for spec in late
    )
    explanation = replace(stribeck_case.explanation, augmented=augmented, effects=named)
    first, other = confirmed_by(second, explanation)
    assert not first.doubtful
    assert other.evidence == first.evidence


def test_of_a_joint_that_rests_in_the_second_recording_nothing_is_said(record, stribeck_case):
    second = record(command=motion() * [0.0, 1.0])
    (effect,) = confirmed_by(second, stribeck_case.explanation)
    assert not effect.doubtful
    assert 'second_p_value' not in effect.evidence


def test_plants_are_judged_on_a_second_recording(stribeck_case, record):
    explanation = stribeck_case.explanation
    second = record(explanation.augmented, duration=8.0, seed=9)
    for ladder in ladders(explanation, second):
        assert set(ladder) == {'nominal', 'refitted', 'augmented'}
        left = {name: fits['wires/measured_js:wire_x_pos'].ratio for name, fits in ladder.items()}
        assert left['augmented'] < 1.5 < left['refitted']
