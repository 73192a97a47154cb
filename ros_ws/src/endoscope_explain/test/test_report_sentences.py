import dataclasses
import re

from test_report_html import PLANT, is_short, named, text_of, with_explanation

from endoscope_explain.explanation import NominalEstimate, Verdict
from endoscope_explain.report.html_page import html_page
from endoscope_explain.report.sentences import next_step, reservations, told, verdict_sentence


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
    assert told(case).splitlines()[1:3] == [stays, besides]
