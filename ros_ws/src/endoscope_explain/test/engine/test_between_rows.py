"""Tables whose rows are slower than the motors: what the command did between them."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_explain.fit.nominal import with_command_between_rows
from endoscope_explain.recording import Series

PAUSE = slice(800, 1200)
"""Ticks in which the command stands still."""


def taken(series, rows):
    """What was in force, or read last, at each row."""
    index = np.searchsorted(series.time, rows, side='right') - 1
    return Series.of(series.topic, rows, series.values[index])


@pytest.fixture
def table(one_joint):
    """Makes a table of rows some seconds apart, and a plant of whose rig it is."""

    def made(period, held):
        plant = one_joint.rig()
        asked = one_joint.motion(6.0)
        rest = np.full(PAUSE.stop - PAUSE.start, asked[PAUSE.start])
        asked = np.insert(asked, PAUSE.start, rest)
        ticks = 1e-3 * np.arange(len(asked))
        rows = np.arange(0.0, ticks[-1], period)
        if held:
            last = rows[np.searchsorted(rows, ticks, side='right') - 1]
            asked = asked[np.round(1e3 * last).astype(int)]
        whole = one_joint.record(plant, asked)
        slow = {k: taken(s, rows) for k, s in whole.measured().items() if k != 'bending'}
        return replace(whole.with_series(slow), command=taken(whole.command, rows)), plant

    return made


@pytest.mark.parametrize('period', [0.007, 0.02])
@pytest.mark.parametrize('held', [True, False])
def test_a_rig_says_whether_its_command_was_held_from_row_to_row(table, period, held):
    recording, plant = table(period, held)
    found = with_command_between_rows(recording, plant)
    assert (found is recording) == held
    if not held:
        assert f'its rows, {1e3 * period:.1f} ms apart' in found.notes[-1]
        assert np.median(np.diff(found.command.time)) == pytest.approx(1e-3)


def test_over_a_gap_a_command_was_held(table):
    recording, plant = table(0.02, False)
    rows = recording.command.time
    cut = replace(
        recording, command=recording.command.taken((rows < 0.83) | (rows > 1e-3 * PAUSE.stop))
    )
    found = with_command_between_rows(cut, plant)
    assert found is not cut
    within = (found.command.time > 0.83) & (found.command.time < 1e-3 * PAUSE.stop)
    assert np.ptp(found.command.values[within]) == 0.0


def test_a_command_at_the_rate_of_the_graph_stays(one_joint):
    plant = one_joint.rig()
    recording = one_joint.record(plant, one_joint.motion(3.0))
    assert with_command_between_rows(recording, plant) is recording
