"""What the report says of strokes that were made once only."""

import html

import pytest

from endoscope_explain.observe.revisits import Stroke
from endoscope_explain.report.html_page import html_page
from endoscope_explain.report.left_open import MOTION, once_only, visited_once
from endoscope_explain.report.sentences import terminal_text
from endoscope_explain.report.writing import report_mapping


def rise(revisited, low=-1.0, high=1.0):
    return Stroke(low, high, revisited)


def fall(revisited, low=-1.0, high=1.0):
    return Stroke(high, low, revisited)


def test_of_what_was_made_twice_nothing_is_said():
    assert once_only('bend_x', [rise(1.0), fall(0.9), rise(0.8), fall(1.0)]) == ''
    assert once_only('bend_x', []) == ''
    # Nor of the first stroke, from the middle.
    assert once_only('bend_x', [rise(0.0, low=0.0), fall(1.0), rise(1.0)]) == ''


def test_strokes_that_were_made_once_only_are_named_in_degrees():
    made = [fall(1.0), rise(1.0), fall(0.1), rise(0.2, low=-1.05, high=1.22), rise(0.0), fall(0.4)]
    assert once_only('bend_y', made) == (
        'bend_y: 2 of 6 wide strokes were made twice; made once only: the fall from 57 to -57 deg, '
        'the rise from -60 to 70 deg (2 more). What depends on the bend there was fitted, but '
        'could not be checked.'
    )


@pytest.mark.parametrize(
    ('made', 'said'),
    [
        ([rise(0.0), fall(0.3)], 'no wide stroke was made twice'),
        ([rise(1.0), *[fall(0.0)] * 5], 'only 1 of 6 wide strokes was made twice'),
    ],
)
def test_where_hardly_anything_was_made_twice_the_motion_is_proposed(made, said):
    text = once_only('bend_x', made)
    assert text.startswith(f'bend_x: {said}.')
    assert text.endswith(MOTION)


@pytest.fixture
def sound(corpus):
    return corpus.case('sound')


def test_page_and_terminal_say_it_in_one_line_of_each_joint(sound):
    (said,) = visited_once(sound)
    assert said.startswith('bend_x: no wide stroke was made twice.')
    assert said in terminal_text(sound).splitlines()
    page = html.unescape(html_page(sound))
    assert page.count(said) == 1
    assert page.index('held-out parts of this recording') < page.index(said)
    assert 'made twice' not in str(report_mapping(sound))
