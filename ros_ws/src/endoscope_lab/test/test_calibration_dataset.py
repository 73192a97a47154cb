import json

import numpy as np
import pytest

from endoscope_core.errors import FileError, InputError
from endoscope_core.metrics import width_at_mid_height
from endoscope_core.signals import calibration_sinusoid
from endoscope_lab.dataset import (
    CLASSES_DEG,
    configuration_of_size,
    load_dataset,
    make_dataset,
    random_instrument,
    record_calibration,
    save_dataset,
)
from endoscope_lab.dataset.calibration_dataset import ARRAYS_FILE, MANIFEST_FILE
from endoscope_lab.dataset.rig_variation import GREATEST_UNEVENNESS, backlash_sizes, in_tube


@pytest.fixture(scope='module')
def small():
    return make_dataset(seed=3, per_class=1)


@pytest.mark.parametrize('size_deg', [65.0, 78.0, 92.0])
def test_a_tube_is_found_for_a_wanted_size(size_deg):
    instrument = random_instrument(np.random.default_rng(0))
    found = configuration_of_size(instrument, np.deg2rad(size_deg), 0.2)
    sizes = np.rad2deg(backlash_sizes(found.plant))
    assert found.plant == in_tube(instrument, found.bend, 0.2)
    assert np.mean(sizes) == pytest.approx(size_deg, abs=0.05)
    assert np.rad2deg(found.backlash_size) == pytest.approx(size_deg, abs=0.05)
    assert np.ptp(sizes) < 9.0


def test_no_tube_makes_the_friction_of_a_straight_one_vanish():
    instrument = random_instrument(np.random.default_rng(0))
    assert configuration_of_size(instrument, np.deg2rad(5.0)) is None


def test_an_instrument_that_the_most_bent_tube_holds_is_drawn_again():
    held = random_instrument(np.random.default_rng(4), widening=1.8)
    assert configuration_of_size(held, np.deg2rad(70.0), -GREATEST_UNEVENNESS) is None


def test_instruments_differ_and_tubes_bend_them():
    instruments = [random_instrument(np.random.default_rng(seed)) for seed in range(20)]
    joints = [in_tube(each, 2.0).joints['bend_x'] for each in instruments]
    frictions = [joint.joint_friction for joint in joints]
    assert np.std(frictions) > 0.05 * np.mean(frictions)
    assert all(4.1 < joint.pretension < 4.8 for joint in joints)
    bent = [in_tube(each, 3.0).joints['bend_x'].capstan_exponent for each in instruments]
    assert all(b > 1.15 * joint.capstan_exponent for b, joint in zip(bent, joints, strict=True))


def test_every_class_is_there_with_the_size_it_names(small):
    assert small.class_deg.tolist() == list(CLASSES_DEG)
    np.testing.assert_allclose(np.rad2deg(small.backlash_size), CLASSES_DEG, atol=1.1)
    assert small.tension.shape == (7, 9000, 4)
    assert small.actual_angle.shape == (7, 9000, 2)
    assert len(set(small.configuration.tolist())) == 7


def test_the_recorded_loop_has_the_size_of_its_class(small):
    time = np.arange(9000) * 1e-3
    settled = time >= calibration_sinusoid().steady[0]
    for row, actual in enumerate(small.actual_angle.astype(float)):
        widths = [
            width_at_mid_height(small.desired_angle[settled], actual[settled, j]) for j in (0, 1)
        ]
        assert np.rad2deg(np.mean(widths)) == pytest.approx(small.class_deg[row], abs=2.5)


def test_tensions_begin_at_pretension_and_carry_sensor_noise(small):
    start = small.tension[:, :100]
    for entry, wires in zip(small.manifest['recordings'], np.mean(start, axis=1), strict=True):
        tightened = np.repeat([joint['pretension'] for joint in entry['joints'].values()], 2)
        np.testing.assert_allclose(wires, tightened, atol=0.15)
    assert np.all(np.std(np.diff(start, axis=1), axis=1) > 0.01)


def test_tubes_differ_in_where_they_are_bent(small):
    unevenness = [entry['unevenness'] for entry in small.manifest['recordings']]
    assert len(set(unevenness)) == 7
    assert max(np.abs(unevenness)) <= GREATEST_UNEVENNESS


def test_where_a_tube_is_bent_changes_its_tensions_at_the_same_size():
    instrument = random_instrument(np.random.default_rng(1))
    tubes = (configuration_of_size(instrument, 1.2, u) for u in (-0.4, 0.4))
    first, second = (record_calibration(tube.plant, 1).tension for tube in tubes)
    assert np.sqrt(np.mean((first - second) ** 2)) > 0.1


def tube_and_hands(dataset, key):
    """What a key of joint x is in each recording, by the bend where it changes with it."""
    return [entry['joints']['bend_x'][key] for entry in dataset.manifest['recordings']]


def test_one_instrument_is_the_same_as_mounted_in_every_tube(small):
    one = make_dataset(seed=3, per_class=1, one_instrument=True)
    again = make_dataset(seed=3, per_class=1, one_instrument=True, reset_pretension=True)
    np.testing.assert_allclose(np.rad2deg(one.backlash_size), CLASSES_DEG, atol=1.1)
    for key in ('joint_radius', 'pretension'):
        assert len(set(tube_and_hands(small, key))) == 7
        assert len(set(tube_and_hands(one, key))) == 1
    assert len(set(tube_and_hands(again, 'joint_radius'))) == 1
    assert len(set(tube_and_hands(again, 'pretension'))) == 7
    assert (again.manifest['instruments'], again.manifest['reset_pretension']) == ('one', True)
    with pytest.raises(InputError, match='of many instruments'):
        make_dataset(seed=3, per_class=1, reset_pretension=True)


def test_a_brief_calibration_is_of_the_same_tubes(small):
    brief = make_dataset(seed=3, per_class=1, motion='brief')
    assert brief.tension.shape == (7, 3140, 4)
    np.testing.assert_array_equal(brief.joint_size, small.joint_size)
    assert brief.motion == 'brief'


def test_another_seed_of_noise_changes_only_noise():
    plant = in_tube(random_instrument(np.random.default_rng(1)), 2.0)
    first, second = record_calibration(plant, 1), record_calibration(plant, 2)
    difference = first.tension - second.tension
    assert np.std(difference) == pytest.approx(0.02 * np.sqrt(2.0), rel=0.1)
    np.testing.assert_array_equal(record_calibration(plant, 1).tension, first.tension)


def test_it_is_the_same_after_a_round_trip(small, tmp_path):
    save_dataset(small, tmp_path / 'data')
    again = load_dataset(tmp_path / 'data')
    assert again.manifest_hash == small.manifest_hash
    np.testing.assert_array_equal(again.tension, small.tension)
    assert again.manifest['seed'] == 3


def test_a_changed_file_is_found_out(small, tmp_path):
    save_dataset(small, tmp_path / 'data')
    manifest = tmp_path / 'data' / MANIFEST_FILE
    content = json.loads(manifest.read_text())
    content['arrays_sha256'] = '0' * 64
    manifest.write_text(json.dumps(content))
    with pytest.raises(FileError, match='is not what'):
        load_dataset(tmp_path / 'data')
    (tmp_path / 'data' / ARRAYS_FILE).write_bytes(b'PK not a zip')
    with pytest.raises(FileError, match='cannot be read'):
        load_dataset(tmp_path / 'data')


def test_what_is_no_data_set_is_refused(tmp_path):
    with pytest.raises(FileError, match='endoscope dataset'):
        load_dataset(tmp_path)
    with pytest.raises(InputError, match='per_class'):
        make_dataset(seed=1, per_class=0)
    with pytest.raises(InputError, match='nearest is'):
        make_dataset(seed=1, per_class=1, motion='breif')
