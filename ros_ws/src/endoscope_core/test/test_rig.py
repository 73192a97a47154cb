"""rig.yaml: what it does not say is as shipped, what it says wrongly is refused by name."""

import pytest

from endoscope_core.errors import FileError
from endoscope_core.rig import load_rig


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
        ('motors: {speed: .nan}', 'motors.speed is nan: give a number from 0.01 to 100'),
        ('joints: {drive: 9.0}', 'beyond motors.reach 1.6'),
        ('joints: {drive: 1.5}', 'joints.drive 1.5 rad is less than joints.reach 1.75 rad'),
        (
            'devices: {motors: dynamicsel}',
            "motors is 'dynamicsel': give one of simulated, dynamixel",
        ),
        ('simulation: {seed: -1}', 'simulation.seed is -1: give a whole number from 0 on'),
        (
            'tip: {release_speed: 5.0e-5}',
            'tip.release_speed 5e-05 m/s is less than',
        ),
        ('tip: {force_limit: 0}', 'tip.force_limit is 0: give a number from 0.001 to 100'),
        ('instrument: {section_length: 20}', 'section_length is 20: give a number from 0.001 to'),
        ('instrument: {base_frame: /base}', "base_frame is '/base': give a name of letters"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, words):
    with pytest.raises(FileError, match=r'rig\.yaml') as refused:
        load_rig(written(tmp_path, text))
    assert words in str(refused.value)


def test_a_plant_is_named_as_seen_from_the_rig_file(tmp_path):
    own = load_rig(written(tmp_path, 'simulation: {plant: tubes/tight.yaml}'))
    assert own.simulation.plant == str(tmp_path / 'tubes' / 'tight.yaml')
    assert load_rig().simulation.plant == ''
    assert load_rig().devices.motors == 'simulated'


def test_a_file_that_is_not_there_is_said():
    with pytest.raises(FileError, match=r'cannot read nowhere\.yaml'):
        load_rig('nowhere.yaml')
