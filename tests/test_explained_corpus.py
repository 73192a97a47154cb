"""What is found in eight recordings, and how it is reported."""

import json

import pytest

from endoscope_core.physics import PlantDescription, load_plant
from endoscope_explain.explanation import Verdict
from endoscope_explain.report.html_page import html_page
from endoscope_explain.report.numbers import judged
from endoscope_explain.report.sentences import terminal_text
from endoscope_explain.report.writing import write_report

FOUND = {
    'sound': (Verdict.CONSISTENT, {}, []),
    'other_numbers': (Verdict.PARAMETERS_DIFFER, {}, ['transmission']),
    'stopped': (Verdict.MISSING_PHYSICS, {'joint_stop': ('angle_rad', 0.12)}, ['joint']),
    'cell': (Verdict.SENSOR_FAULT, {'load_cell_gain': ('gain', 0.8)}, ['sensing']),
    'unknown': (Verdict.UNKNOWN_PHYSICS, {}, ['transmission']),
    'two_joints': (Verdict.MISSING_PHYSICS, {'joint_stop': ('angle_rad', 0.12)}, ['joint']),
    'again': (Verdict.CONSISTENT, {}, []),
    'degrees': (
        Verdict.RECORDING_FAULT,
        {'load_cell_gain': ('gain', 0.8)},
        ['recording', 'sensing'],
    ),
}
"""Verdict, effects with a number of each, and stages of the places."""


@pytest.mark.parametrize(
    'name',
    [pytest.param(name, marks=pytest.mark.nightly if name == 'cell' else ()) for name in FOUND],
)
def test_what_is_found_is_located_and_reported_alike_everywhere(corpus, name, tmp_path):
    case = corpus.case(name)
    verdict, effects, stages = FOUND[name]
    assert case.verdict is verdict
    assert {(e.id, e.joint) for e in case.effects} == {(e, 'bend_x') for e in effects}
    for effect in case.effects:
        parameter, value = effects[effect.id]
        assert effect.parameters[parameter].value == pytest.approx(value, rel=0.05)
        assert effect.evidence['margin'] > 10.0
    assert [(place.stage, place.joint) for place in case.places] == [(s, 'bend_x') for s in stages]
    ladder = judged(case, case.ladder)
    worst = {plant: max(fit.ratio for fit in fits.values()) for plant, fits in ladder.items()}
    assert list(worst.values())[-1] < 1.3 < worst['nominal']
    write_report(case, tmp_path)
    report = json.loads((tmp_path / 'report.json').read_text())
    assert report['verdict'] == verdict
    assert {e['id'] for e in report['effects']} == set(effects)
    assert [place['stage'] for place in report['where']] == stages
    assert {e.id for e in load_plant(tmp_path / 'plant.yaml').effects} == set(effects)
    page = (tmp_path / 'report.html').read_text()
    assert html_page(case) == page
    sentence, *_ = terminal_text(case).splitlines()
    assert sentence in page.replace('&#39;', "'")


def test_an_effect_is_named_below_a_mistake_in_units_and_its_misfit_is_said(corpus):
    case = corpus.case('degrees')
    assert 'As corrected: The recording shows load_cell_gain on bend_x.' in terminal_text(case)
    (mistake,) = case.audit.mistakes()
    assert mistake.evidence['misfit_corrected'] < 0.1 < 0.9 < mistake.evidence['misfit']
    assert '(misfit 100 % as recorded, ' in mistake.text


def test_the_engine_is_refused_what_is_not_in_the_corpus(corpus):
    recording = corpus.case('sound').recording
    with pytest.raises(AssertionError, match='sound would be explained by the engine'):
        corpus.explain_recording(recording, PlantDescription())
