"""The report of `endoscope demo`: all that was measured is in one page that needs no other file."""

import re

import numpy as np
import pytest

from endoscope_bringup.demo.page import report_page, table_rows
from endoscope_bringup.demo.procedure import MOTIONS, TABLE_5, TUBES, Mode
from endoscope_bringup.demo.results import CalibrationOutcome, DemoResults, TrackingRun
from endoscope_bringup.demo.run_demo import figures_table

TIME = 0.025 * np.arange(800)
RMSE = {Mode.NONE: 37.48, Mode.FEED_FORWARD: 5.02, Mode.ADAPTIVE: 4.97}
BACKLASH = {Mode.NONE: 91.07, Mode.FEED_FORWARD: 4.78, Mode.ADAPTIVE: 0.27}


def calibration(tube: str) -> CalibrationOutcome:
    time = 1e-3 * np.arange(9000)
    desired = 90.0 * np.sin(time)
    return CalibrationOutcome(
        tube,
        time,
        5.0 + np.outer(np.sin(time), [1.0, -1.0, 1.0, -1.0]),
        ('wire_x_pos', 'wire_x_neg', 'wire_y_pos', 'wire_y_neg'),
        desired,
        90.0 * np.sin(time - 0.4),
        93.7,
        90.0,
        {40: 0.0, 50: 0.0, 60: 0.0, 70: 0.0, 80: 0.02, 90: 0.97, 100: 0.01},
        10.52,
    )


@pytest.fixture(scope='module')
def results() -> DemoResults:
    desired = 60.0 * np.sin(TIME)
    return DemoResults(
        tuple(calibration(tube.name) for tube in TUBES),
        tuple(
            TrackingRun(
                tube.name,
                motion,
                mode,
                TIME,
                desired,
                60.0 * np.sin(TIME - 0.01 * RMSE[mode]),
                RMSE[mode],
                BACKLASH[mode],
            )
            for tube in TUBES
            for motion in MOTIONS
            for mode in Mode
        ),
        {'/endoscope/motor/servo_jp': 61234, '/endoscope/slave/measured_js': 2449},
        {'/endoscope/motor/servo_jp': 3, '/endoscope/slave/measured_js': 0},
    )


@pytest.fixture(scope='module')
def page(results: DemoResults) -> str:
    return report_page(results, {'date': '2026-11-21 08:00 UTC'})


def test_the_page_needs_no_other_file(page):
    loaded = re.findall(r'(?:src|href)\s*=\s*["\']([^"\']+)', page)
    assert [link for link in loaded if not link.startswith(('#', 'data:'))] == []
    assert '@import' not in page
    assert not re.search(r'url\((?!["\']?(#|data:))', page)


def test_everything_that_was_measured_is_shown(page):
    # Loops, tracking of each motion, and a calibration, for each tube.
    assert page.count('<svg') == len(TUBES) * (2 + len(MOTIONS))
    for text in ('37.48', '5.02', '4.97', '91.07', '0.27', '10.5', '61234', '2026-11-21 08:00 UTC'):
        assert text in page.replace('\u202f', '').replace(',', ''), text
    for tube in TUBES:
        assert tube.name in page


def test_the_table_stands_beside_the_papers(results):
    rows = table_rows(results)
    assert len(rows) == 2 * len(TUBES) * len(MOTIONS)
    for row, (tube, motion) in zip(rows[::2], TABLE_5, strict=True):
        assert row.tube == tube
        assert (row.paper_none, row.paper_proposed) == TABLE_5[tube, motion][:2]
        assert row.feed_forward_left == pytest.approx(5.02 / 37.48)
    text = figures_table(results).splitlines()
    assert len(text) == 1 + len(rows)
    assert '18.08 ± 0.35' in text[1]


def test_a_run_that_was_not_made_is_named(results):
    with pytest.raises(KeyError, match='sigmoid colon'):
        results.run('sigmoid colon', MOTIONS[0], Mode.NONE)
