"""The family of tubes: over the bend, in a file, identified, and never bending the wrong way."""

from dataclasses import replace

import numpy as np
import pytest
from outside_data import REAL, needs
from wrong_way import wrong_way_motion

from endoscope_core.errors import FileError, InputError
from endoscope_core.identification.family_fit import (
    PRIORS,
    TubeRecording,
    fit_family,
    misfit,
    read,
    tube_recordings,
)
from endoscope_core.physics import PlantDescription, simulate
from endoscope_core.physics.family import (
    CENTRE,
    MOST_BENT,
    Readings,
    TubeFamily,
    load_family,
    shipped_family,
)

BENDS = np.deg2rad([0.0, 60.0, 120.0, 180.0, 240.0])
TICK = 5e-3
MADE_UP = TubeFamily(
    {
        'capstan_exponent': (0.9, 0.4),
        'joint_stiffness': (0.005,),
        'joint_rest_angle': (-0.05, 0.01, 0.02),
    },
    readings=Readings((0.3, -0.1), 0.05, 0.01),
)


def test_a_line_takes_its_value_at_the_centre_and_grows_by_a_factor():
    lines = {'capstan_exponent': (0.9, 0.4), 'joint_rest_angle': (-0.05, 0.01, 0.02)}
    family = TubeFamily(lines, (0.2,))
    middle, straight, bent = (family.joint(bend) for bend in (CENTRE, 0.0, 2.0 * CENTRE))
    assert middle.capstan_exponent == pytest.approx(0.9)
    assert bent.capstan_exponent * straight.capstan_exponent == pytest.approx(0.81)
    assert bent.capstan_exponent / middle.capstan_exponent == pytest.approx(np.exp(0.4))
    assert straight.joint_rest_angle == pytest.approx(-0.05 - 0.01 + 0.02)
    assert bent.joint_rest_angle == pytest.approx(-0.05 + 0.01 + 0.02)
    assert middle.friction_profile == (0.2,)
    assert middle.wire_stiffness == 3000.0


def test_a_file_gives_the_family_back(tmp_path):
    family = replace(shipped_family(), provenance={'date': 'a day'})
    family.save(tmp_path / 'family.yaml')
    again = load_family(tmp_path / 'family.yaml')
    assert again == family


@pytest.mark.parametrize(
    ('text', 'named'),
    [
        ('schema: 2', 'schema is 2: give 1'),
        ('schema: 1\nlines: {capstan_exponnt: [1.0]}', 'capstan_exponent'),
        ('schema: 1\nlines: {capstan_exponent: [-1.0]}', 'positive'),
        ('schema: 1\nlines: {capstan_exponent: 1.0}', 'list'),
        (
            'schema: 1\nlines: {capstan_exponent: [1.0, .nan]}',
            r'capstan_exponent.1. is nan: give a finite number',
        ),
        ('schema: 1\nreading: {}', 'readings'),
        ('schema: 1\nreadings: {load_cell_offset: [1.0]}', 'two numbers'),
    ],
)
def test_a_wrong_file_is_refused_by_name(tmp_path, text, named):
    path = tmp_path / 'family.yaml'
    path.write_text(text)
    with pytest.raises(FileError, match=named):
        load_family(path)


@pytest.mark.parametrize('bend', [-0.1, MOST_BENT + 0.1])
def test_a_tube_out_of_the_family_is_refused(bend):
    with pytest.raises(InputError, match='reaches from 0 to 300 deg'):
        shipped_family().joint(bend)


@pytest.mark.parametrize('amplitude_deg', [30.0, 60.0, 90.0])
def test_no_tube_of_the_family_bends_the_wrong_way(amplitude_deg):
    time = TICK * np.arange(1800)
    command = 0.5 * np.deg2rad(amplitude_deg) * np.sin(time)
    for bend_deg in range(0, 271, 30):
        joint = shipped_family().joint(np.deg2rad(bend_deg))
        made = simulate(PlantDescription(joints={'bend_x': joint}), command[:, None], TICK)
        wrong = wrong_way_motion(made.shaft_position[:, 0], made.bending_true[:, 0])
        assert wrong < np.deg2rad(0.3), bend_deg


def test_motion_against_the_motor_is_seen():
    motor = np.array([0.0, 1.0, 2.0, 3.0, 2.0, 1.0])
    assert wrong_way_motion(motor, 0.5 * motor) == 0.0
    assert wrong_way_motion(motor, [0.0, -0.2, 1.0, 1.5, 1.8, 0.0]) == pytest.approx(0.3)


def made_up_recording(family: TubeFamily, bend: float) -> TubeRecording:
    desired = np.deg2rad(60.0) * np.sin(1.1 * TICK * np.arange(1200))
    angle, tension = read(family, bend, desired, TICK)
    return TubeRecording(bend, TICK, desired, angle, tension, (0, 1143))


def test_known_numbers_are_found_again():
    recordings = [made_up_recording(MADE_UP, bend) for bend in BENDS[::2]]
    free = ('capstan_exponent', 'joint_stiffness', 'joint_rest_angle', 'load_cell_offset')
    wide = {key: (PRIORS[key][0], tuple(20.0 * w for w in PRIORS[key][1])) for key in free}
    delays = {'load_cell_delay': ((0.05,), (1e-6,)), 'tracker_delay': ((0.01,), (1e-6,))}
    found = fit_family(recordings, {**wide, **delays}, starts=1)
    for key in free[:3]:
        line = (*MADE_UP.lines[key], 0.0, 0.0)[: len(found.lines[key])]
        np.testing.assert_allclose(found.lines[key], line, rtol=0.03, atol=3e-3)
    np.testing.assert_allclose(found.readings.load_cell_offset, (0.3, -0.1), atol=0.01)


def test_recordings_that_tell_nothing_are_refused():
    with pytest.raises(InputError, match='no recordings'):
        fit_family([])
    recording = made_up_recording(MADE_UP, 0.0)
    with pytest.raises(InputError, match='bent by 0 deg: 50 samples'):
        fit_family([recording.until(50)])
    recording.angle[3] = np.nan
    with pytest.raises(InputError, match='not finite'):
        fit_family([recording])


@needs(REAL)
def test_the_shipped_family_reads_as_the_real_rig_does_in_the_cycle_not_fitted():
    recordings = tube_recordings(REAL)
    assert [recording.bend for recording in recordings] == pytest.approx(list(BENDS))
    for recording in recordings:
        left = misfit(shipped_family(), recording, 2)
        assert np.rad2deg(left.angle) < 1.5, recording.bend
        assert left.tension.max() < 0.4, recording.bend
