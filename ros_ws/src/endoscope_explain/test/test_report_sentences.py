import dataclasses
import re
from dataclasses import replace

import numpy as np
import pytest
from test_report_html import PLANT, is_short, named, text_of, with_explanation

from endoscope_explain import prediction_set
from endoscope_explain.explanation import ChannelFit, NominalEstimate, Verdict
from endoscope_explain.prediction_set import Contest
from endoscope_explain.report.html_page import html_page
from endoscope_explain.report.left_open import what_is_open
from endoscope_explain.report.sentences import (
    next_step,
    reservations,
    terminal_text,
    verdict_sentence,
)


def test_a_number_at_a_bound_is_told_as_one_and_none_that_is_not_shown(stribeck_case):
    most = NominalEstimate(2.4, 2.3, 2.4, 'N', 2.0, True, at_bound=True)
    hidden = NominalEstimate(0.006, 0.0055, 0.0065, 'N m/rad', 0.0045, False, shown=False)
    parameters = {'bend_x': {'pretension': most, 'joint_stiffness': hidden}}
    differs = Verdict.PARAMETERS_DIFFER
    case = with_explanation(
        stribeck_case, parameters=parameters, effects=(), verdict=differs, plant=PLANT
    )
    assert verdict_sentence(case) == 'pretension of bend_x is 2.4 N or more instead of 2 N.'
    assert 'pretension N 2 at a bound: or more' in text_of(html_page(case))


def test_two_cells_that_clip_are_told_apart_and_what_else_differs_is_said(stribeck_case):
    cells = tuple(named('load_cell_saturation', limit_n=7.0, wire=float(k)) for k in range(2))
    case = dataclasses.replace(stribeck_case, verdict=Verdict.SENSOR_FAULT, effects=cells)
    first, second = re.findall(r'bend_x \((.*?)\)', verdict_sentence(case))
    assert (first, second) == ('the cell of the positive wire', 'the cell of the negative wire')
    unknown = with_explanation(
        stribeck_case, verdict=Verdict.UNKNOWN_PHYSICS, effects=cells[:1], unknown=None
    )
    assert verdict_sentence(unknown) == (
        'There is load_cell_saturation on bend_x, and nothing explains what else differs on bend_x.'
    )


def test_a_plant_that_lacks_the_main_thing_is_not_recommended(stribeck_case):
    ladder = dict(stribeck_case.ladder)
    ladder['augmented'] = ladder['refitted'] = ladder['nominal']
    lost = with_explanation(
        stribeck_case,
        verdict=Verdict.UNKNOWN_PHYSICS,
        effects=(),
        unknown=None,
        adequate=False,
        ladder=ladder,
    )
    assert next_step(lost).startswith('Do not continue with plant.yaml')
    assert 'is still off by' in ' '.join(reservations(lost))


def test_what_names_leave_over_and_what_differs_besides_is_said_under_the_headline(stribeck_case):
    assert reservations(stribeck_case) == []
    signals = stribeck_case.ladder['augmented']
    first, second, *_ = signals
    ladder = dict(stribeck_case.ladder)
    ladder['augmented'] = signals | {
        first: dataclasses.replace(signals[first], rmse=4.2 * signals[first].noise),
        second: dataclasses.replace(signals[second], rmse=1.5 * signals[second].noise),
    }
    stiff = NominalEstimate(0.006, 0.0055, 0.0065, 'N m/rad', 0.0045, False)
    inside = NominalEstimate(5.3, 5.2, 5.4, 'N', 5.0, True)
    parameters = {'bend_x': {'joint_stiffness': stiff, 'pretension': inside}}
    case = with_explanation(stribeck_case, ladder=ladder, parameters=parameters)
    stays, besides = reservations(case)
    assert 'is still off by 4.2 times its noise, and 1 more is off.' in stays
    assert besides == 'Besides, joint_stiffness of bend_x is 0.006 instead of 0.0045 N m/rad.'
    assert all(map(is_short, (stays, besides)))
    text = text_of(html_page(case))
    assert stays in text
    assert besides in text
    assert terminal_text(case).splitlines()[1:3] == [stays, besides]


def test_names_that_are_left_open_are_said_with_their_probabilities(stribeck_case, monkeypatch):
    monkeypatch.setattr(prediction_set, 'MASS', 0.7)
    monkeypatch.setattr(Contest, 'probabilities', lambda _: np.array([0.6, 0.3, 0.02, 0.08]))
    names = (('stribeck_friction',), ('exponent_of_speed', 'viscous_friction'))
    tried = Contest(names, (90.0, 80.0), 5.0, found=True)
    (effect,) = stribeck_case.effects
    effect = replace(effect, contest=tried, alternatives=names[1])
    case = with_explanation(stribeck_case, effects=(effect,), contests={'bend_x': tried})
    said = (
        'stribeck_friction (0.60) or exponent_of_speed (a function of sliding speed, never '
        'negative, here the same as viscous_friction, 0.30)'
    )
    assert verdict_sentence(case) == f'The simulation leaves out {said} on bend_x.'
    assert what_is_open(effect) == f'The recording leaves open: {said}.'
    assert any('Whether bend_x lacks something more' in line for line in reservations(case))
    assert what_is_open(replace(effect, contest=None, alternatives=())).startswith('No alternative')


def test_a_function_that_repairs_form_is_said_to_be_in_the_plant(stribeck_case):
    case = with_explanation(stribeck_case, repairs_form=(('bend_y', 'load_of_angle'),))
    assert any(
        line.startswith("The improved plant has a function of the joint's angle on bend_y as well")
        for line in reservations(case)
    )


@pytest.mark.parametrize(('ratio', 'kind'), [(1.1, 'best'), (245.0, 'bad')])
def test_a_signal_that_stays_far_off_is_not_marked_as_well_explained(stribeck_case, ratio, kind):
    signal = next(iter(stribeck_case.ladder['nominal']))
    fits = {signal: ChannelFit(ratio, 1.0)}
    case = replace(stribeck_case, ladder={'nominal': fits, 'refitted': fits, 'augmented': fits})
    cells = re.findall(
        r'<td class="(best|bad)">', html_page(case).split('<h2>The ladder of fits')[1]
    )
    assert kind in cells
    assert {'best', 'bad'} - {kind} != set(cells)
