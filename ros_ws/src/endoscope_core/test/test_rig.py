"""rig.yaml: what it does not say is as shipped, what it says wrongly is refused by name."""

import pytest

from endoscope_core.rig import RigFileError, load_rig


def written(tmp_path, text):
    path = tmp_path / 'rig.yaml'
    path.write_text(text)
    return path


def test_what_a_file_does_not_say_is_as_shipped(tmp_path):
    shipped, own = load_rig(), load_rig(written(tmp_path, 'motors: {speed: 2.0}'))
    assert own.motors.speed == 2.0
    assert own.motors.acceleration == shipped.motors.acceleration
    assert own.joints == shipped.joints


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('motors: {sped: 2.0}', 'unknown key sped: did you mean speed'),
        ('motor: {speed: 2.0}', 'unknown key motor: did you mean motors'),
        ('motors: {speed: .nan}', 'motors.speed is nan: give a number from 0.01 to 100'),
        ('motors: {speed: 1e9}', 'give a number'),
        ('motors: {speed: fast}', "motors.speed is 'fast': give a number"),
        ('motors: 3', 'motors has to be a mapping, not 3'),
        ('joints: {drive: 9.0}', 'beyond motors.reach 1.6'),
        ('- 1', 'has to be a mapping'),
        ('motors: {speed: 1.0, speed: 2.0}', 'speed'),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, words):
    with pytest.raises(RigFileError, match=r'rig\.yaml') as refused:
        load_rig(written(tmp_path, text))
    assert words in str(refused.value)


def test_a_file_that_is_not_there_is_said():
    with pytest.raises(RigFileError, match=r'cannot read nowhere\.yaml'):
        load_rig('nowhere.yaml')
