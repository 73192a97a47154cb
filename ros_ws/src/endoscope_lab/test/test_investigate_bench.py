"""Rigs with injected effects under investigation: motions that are played."""

import numpy as np
import pytest

from endoscope_core.names import JOINTS
from endoscope_core.physics import PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_core.signals.sampled_motion import CommandTable
from endoscope_explain.investigation.motions import RigMotion, commissioning, require_allowed
from endoscope_explain.takes import recordings_joined
from endoscope_lab.investigate import (
    FIXED,
    KINDS,
    SimulatedRig,
    calibration,
    drawn_rig,
    fixed_motion,
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


def test_the_calibration_bends_every_joint_to_both_sides():
    table = calibration(JOINTS)
    assert table.time[-1] == pytest.approx(10.0, abs=0.1)
    assert np.abs(table.angle[[0, -1]]).max() < 1e-9
    assert table.angle.max(axis=0) == pytest.approx(0.5 * np.pi, rel=1e-3)
    assert table.angle.min(axis=0) == pytest.approx(-0.5 * np.pi, rel=1e-3)


@pytest.mark.parametrize('joints', [('bend_x',), ('bend_x', 'bend_y')])
def test_the_fixed_motion_is_allowed_and_begins_as_the_requested_one(joints):
    plant = PlantDescription().of_joints(joints)
    first = commissioning(plant, RIG)
    longer = fixed_motion(first, 3.0 * first.duration)
    assert longer.time[-1] == pytest.approx(3.0 * first.duration, abs=1.5)
    np.testing.assert_array_equal(longer.angle[: len(first.table.time)], first.table.angle)
    require_allowed(RigMotion(FIXED, '', '', longer), RIG)
    moved = np.abs(longer.angle[len(first.table.time) :]).max(axis=0) > 0.1
    assert moved.tolist() == [joint in joints for joint in longer.joints]
