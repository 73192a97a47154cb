"""The family of tubes: over the bend, in a file, identified, and never bending the wrong way."""

from dataclasses import replace

import numpy as np
import pytest
from wrong_way import wrong_way_motion

from endoscope_core.errors import FileError, InputError
from endoscope_core.physics import PlantDescription, simulate
from endoscope_core.physics.family import CENTRE, MOST_BENT, TubeFamily, load_family, shipped_family

TICK = 5e-3


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
