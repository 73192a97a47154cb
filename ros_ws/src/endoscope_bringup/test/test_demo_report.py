"""The report of `endoscope demo`: what is said and marked follows from the figures alone."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chromium import LARGEST_PAGE, drawn

from endoscope_bringup.demo.procedure import MOTIONS, TUBES, CalibrationFacts, Method, RecordedRun
from endoscope_bringup.demo.report_page import (
    endoscope_picture,
    headline,
    report_page,
    where_signals_were_cut,
)
from endoscope_bringup.demo.results import (
    Angles,
    CalibrationOutcome,
    DemoResults,
    TrackingRun,
    figures_table,
    ranking,
    run_of,
    start_of_motion,
    table_rows,
)
from endoscope_core.signals import motion_by_name

ROOT = Path(__file__).parents[4]
LAG = {Method.NONE: 0.4, Method.BOUC_WEN: 0.1, Method.INVERSE: 0.02}
REACH = ((-61.7, 51.5), (-61.7, 51.5))


def calibration(tube):
    time = 1e-3 * np.arange(9000)
    both = np.column_stack([time, time])
    return CalibrationOutcome(
        CalibrationFacts(
            tube,
            3.0,
            90.0,
            {40: 0.0, 50: 0.0, 60: 0.0, 70: 0.0, 80: 0.02, 90: 0.97, 100: 0.01},
            10.52,
            REACH,
        ),
        time,
        5.0 + np.outer(np.sin(time), [1.0, -1.0, 1.0, -1.0]),
        ('wire_x_pos', 'wire_x_neg', 'wire_y_pos', 'wire_y_neg'),
        time,
        90.0 * np.sin(both),
        90.0 * np.sin(both - 0.4),
    )


def run(tube, motion, method, lag):
    """A tip that does what was asked of it some time ago."""
    signal = motion_by_name(motion)
    time = np.arange(*signal.steady, 0.025)
    desired, late = (np.degrees(signal.sample(t)[0]) for t in (time, time - lag))
    return TrackingRun(tube, motion, method, time, desired, late)


def results_of(lag):
    return DemoResults(
        tuple(calibration(tube.name) for tube in TUBES),
        tuple(
            run(tube.name, motion, method, lag[method])
            for tube in TUBES
            for motion in MOTIONS
            for method in Method
        ),
        0.25,
        {'/endoscope/motor/servo_jp': 61234, '/endoscope/slave/measured_js': 2449},
        {'/endoscope/motor/servo_jp': 3, '/endoscope/slave/measured_js': 0},
    )


@pytest.fixture(scope='module')
def results():
    return results_of(LAG)


@pytest.fixture(scope='module')
def page(results):
    return report_page(results, {'date': '2026-11-21 08:00 UTC'})


def test_the_page_needs_no_other_file(page):
    loaded = re.findall(r'(?:src|href)\s*=\s*["\']([^"\']+)', page)
    assert [link for link in loaded if not link.startswith(('#', 'data:'))] == []
    assert '@import' not in page
    assert not re.search(r'url\((?!["\']?(#|data:))', page)


def test_the_page_is_drawn_without_a_complaint(page):
    assert len(page) < LARGEST_PAGE
    with drawn(page) as (seen, complaints):
        assert seen.locator('.plots.is-drawn').count() == page.count('<figure class="plots">')
        assert seen.locator('.plot canvas').count() == page.count('class="plot"')
    assert complaints == []


def test_the_best_method_comes_first_by_its_numbers():
    rows = table_rows(results_of(LAG | {Method.INVERSE: 0.2}))
    assert ranking(rows) == [Method.BOUC_WEN, Method.INVERSE, Method.NONE]
    assert all(row.is_best(m) == (m is Method.BOUC_WEN) for row in rows for m in Method)
    assert figures_table(rows).count('*') == len(rows)


def test_the_page_says_whose_equations_the_inverse_uses(page):
    text = ' '.join(page.split())
    assert 'uses the equations by which these tubes are simulated' in text
    # test_another_simulator.py of the lab measures these.
    assert 'In three tubes of another simulator it left 1 to 2 %' in text
    assert 'the Bouc-Wen model of the class 16 to 30 %' in text


def test_no_method_is_praised_where_none_helps():
    lag = {Method.NONE: 0.1, Method.BOUC_WEN: 0.2, Method.INVERSE: 0.3}
    worse = results_of(lag)
    assert 'no compensation makes the error smaller' in headline(table_rows(worse))
    assert 'is best' not in report_page(worse, {})


def test_a_signal_that_a_tube_cannot_follow_is_said_to_be_cut(results):
    assert where_signals_were_cut(results, Method.INVERSE) == []
    runs = tuple(replace(r, desired_deg=np.minimum(r.desired_deg, 51.5)) for r in results.runs)
    said = where_signals_were_cut(replace(results, runs=runs), Method.INVERSE)
    assert len(said) == len(TUBES)
    assert 'can be bent from -62° to 52° only' in said[0]
    assert '60 sin t by up to 8.5°' in said[0]


def test_a_run_is_compared_with_what_was_asked_for_in_that_run():
    """Each run begins when the tip has come to the signal's start, which takes its own time."""
    signal = motion_by_name('periodic')
    asked_time = 1e-3 * np.arange(17_000)
    for way in (0.2, 1.1):
        asked = signal.sample(asked_time - way)[0]
        early = asked_time < way
        asked[early] = 0.3 * (way - asked_time[early, None])
        stamps = asked_time[::25]
        angles = Angles(100.0 + stamps, asked[::25] + 0.01, 100.0 + asked_time, asked)
        made = run_of(angles, RecordedRun('t', 'periodic', Method.NONE, 100.0, 116.0))
        assert made.desired_deg[:, 0] == pytest.approx(60.0 * np.sin(made.time), abs=0.1)
        assert made.rmse_deg == pytest.approx(np.degrees(0.01))


def test_the_start_of_a_motion_is_found_though_it_was_cut():
    signal = motion_by_name('non_periodic').joints['bend_x']
    time = 1e-3 * np.arange(26_000)
    desired = np.clip(signal(time - 0.437)[0], -0.7, 0.6)
    assert start_of_motion(time, desired, signal) == pytest.approx(0.437, abs=1e-3)


def test_a_run_that_ended_before_its_motion_did_is_refused():
    signal = motion_by_name('periodic')
    time = 1e-3 * np.arange(15_000)
    asked = signal.sample(time - 2.5)[0]
    angles = Angles(time[::25], asked[::25], time, asked)
    with pytest.raises(ValueError, match='descending colon, periodic, uncompensated'):
        run_of(angles, RecordedRun('descending colon', 'periodic', Method.NONE, 0.0, 15.0))


def test_the_documentation_shows_the_drawing_that_the_page_has():
    assert (ROOT / 'ros_ws/doc/endoscope.svg').read_text() == endoscope_picture()
