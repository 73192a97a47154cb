"""What of a plant file is put into force, and why it is refused."""

import numpy as np
import pytest

from endoscope_core.control import AdoptionError, adopted_plant
from endoscope_core.names import JOINTS
from endoscope_core.physics import EffectSpec, PlantDescription
from endoscope_core.physics.plant_file import plant_as_text
from endoscope_core.rig import load_rig
from endoscope_core.safety import AdoptionCode

RIG = load_rig()


def text_with(*effects):
    return plant_as_text(PlantDescription(effects=effects))


@pytest.fixture(scope='module')
def with_play():
    return adopted_plant(
        text_with(
            EffectSpec('gear_backlash', 'bend_x', {'gap_rad': 0.3}),
            EffectSpec('breathing', 'bend_y', {}),
        ),
        RIG,
        JOINTS,
    )


def test_the_inverse_has_what_stands_between_motor_and_tip(with_play):
    assert [entry.id for entry in with_play.parameters[0].added] == ['gear_backlash']
    assert with_play.parameters[1].added == ()
    with_it, without = with_play.tried
    assert with_it < without


def test_what_depends_on_time_is_left_out_and_named(with_play):
    assert with_play.left_out == ('breathing of bend_y',)


def test_what_the_inverse_tracks_worse_with_is_left_out_and_named():
    inertia = EffectSpec('joint_inertia', 'bend_x', {})
    play = EffectSpec('gear_backlash', 'bend_x', {'gap_rad': 0.3})
    adopted = adopted_plant(text_with(inertia, play), RIG, JOINTS)
    assert adopted.left_out == ('joint_inertia of bend_x',)
    assert adopted.parameters[0].added == (play,)
    with_it, without = adopted.tried
    assert with_it < 0.1 * without


def test_the_range_is_within_the_reach_of_the_rig(with_play):
    ends = np.array([(within.low, within.high) for within in with_play.ranges])
    assert np.all(np.abs(ends) <= RIG.joints.reach)
    with_play.check_within((0.0, 0.0), JOINTS)
    with pytest.raises(AdoptionError, match='bend_y is at'):
        with_play.check_within((0.0, 1.01 * ends[1, 1]), JOINTS)


WEAK = EffectSpec('torque_limit', 'bend_x', {'limit_nm': 0.001})


@pytest.mark.parametrize(
    ('text', 'code'),
    [
        ('', AdoptionCode.NOT_A_PLANT),
        ('joints: [', AdoptionCode.NOT_A_PLANT),
        ('joints: {bend_x: {stiff: 1}}', AdoptionCode.NOT_A_PLANT),
        ('x' * 100_001, AdoptionCode.NOT_A_PLANT),
        ('joints: {bend_x: {}}', AdoptionCode.OTHER_JOINTS),
        (text_with(WEAK), AdoptionCode.NOT_INVERTIBLE),
    ],
)
def test_what_cannot_be_inverted_is_refused_in_one_line(text, code):
    with pytest.raises(AdoptionError) as error:
        adopted_plant(text, RIG, JOINTS)
    assert error.value.code == code
    assert '\n' not in str(error.value)
