"""Rigs with injected effects under investigation: motions that are played, and their table."""

import numpy as np
import pytest

from endoscope_core.names import JOINTS
from endoscope_core.rig import shipped_rig
from endoscope_core.signals.sampled_motion import CommandTable
from endoscope_explain.takes import recordings_joined
from endoscope_lab.concealed.trial import failed
from endoscope_lab.investigate import (
    ASKED,
    CALIBRATED,
    COLUMNS,
    COMMISSIONED,
    KINDS,
    Asked,
    SimulatedRig,
    drawn_rig,
    table,
)

RIG = shipped_rig()


@pytest.mark.parametrize(
    'stratum',
    [
        pytest.param(s, marks=() if s == 'catalogue' else pytest.mark.nightly)
        for s in KINDS.values()
    ],
)
def test_a_rig_continues_from_one_motion_to_the_next(stratum):
    case, read = drawn_rig(stratum, 1)
    joints = case.true.joint_names()
    time = np.arange(0.0, 3.0, 0.01)
    wave = np.sin(2.0 * time) * np.minimum(1.0, 3.0 - time)
    table = CommandTable(JOINTS, time, np.column_stack([0.5 * wave, 0.2 * wave]))
    rig = SimulatedRig(case, read, np.inf)
    recordings = [rig.recorded(table, name) for name in ('first', 'second')]
    for one in recordings:
        assert one.joints == joints
        assert one.command.time[0] == one.bending.time[0] == 0.0
        np.testing.assert_allclose(one.command.values[:, 0], RIG.joints.gear * 0.5 * wave_of(one))
    first, second = (one.tension.values for one in recordings)
    # A sheath remembers where it has been.
    assert np.abs(first[:20] - second[:20]).max() > 0.2
    # The readings are those of all motions played as one.
    joined = recordings_joined(recordings)
    again = read(joined_command(joined))
    begin = round(joined.restarts[0].time / 1e-3)
    clean = again.tension[begin : begin + len(second)]
    assert np.abs(second - clean).max() < 8.0 * case.true.sensors.load_cell_noise
    same = SimulatedRig(*drawn_rig(stratum, 1), np.inf).recorded(table, 'first')
    np.testing.assert_array_equal(same.tension.values, first)


def wave_of(recording):
    time = np.arange(0.0, 3.0, 0.01)
    wave = np.sin(2.0 * time) * np.minimum(1.0, 3.0 - time)
    return np.interp(recording.command.time, time, wave)


def joined_command(recording):
    """The shaft's command every ms, each in force until the next one."""
    time = recording.command.time
    ticks = np.arange(0.0, time[-1] + 5e-4, 1e-3)
    return recording.command.values[np.searchsorted(time, ticks + 1e-6, side='right') - 1]


def explained_by(by, seed, experiments, motion_s, right, size=1.0):
    row = vars(failed('catalogue', seed, ValueError('made up')))
    judged = {'first_of_identifiable': right, 'in_set': right, 'set_size': size, 'false': 0}
    return Asked(**{**row, **judged}, by=by, experiments=experiments, motion_s=motion_s)


def test_the_table_counts_the_motion_until_the_right_name_is_left_and_stays():
    rows = [
        explained_by(CALIBRATED, 1, 0, 10.0, True),
        explained_by(ASKED, 1, 0, 10.0, True),
        explained_by(CALIBRATED, 2, 0, 10.0, True, 2.0),
        explained_by(ASKED, 2, 1, 15.0, True),
        explained_by(ASKED, 2, 2, 21.0, True),
        # Left alone and then lost: wrong by asking.
        explained_by(CALIBRATED, 3, 0, 10.0, True),
        explained_by(ASKED, 3, 1, 16.0, False),
        explained_by(COMMISSIONED, 3, 0, 28.8, False),
    ]
    lines = [line.split('|')[1:-1] for line in table(rows).splitlines()[2:]]
    cells = {row[1]: row for line in lines if (row := [cell.strip() for cell in line])[0] == 'all'}
    shown = ('number', 'alone', 'became wrong', 's to it, median', '90 %', 'most motions')

    def of(by):
        return [cells[by][COLUMNS.index(name)] for name in shown]

    assert of(CALIBRATED) == ['3', '67 %', '0', '10', 'never', '1']
    assert of(ASKED) == ['3', '67 %', '1', '15', 'never', '3']
    assert of(COMMISSIONED) == ['1', '0 %', '0', 'never', 'never', '1']
