import json

import numpy as np
import pytest

from endoscope_core.dataset import (
    CLASSES_DEG,
    DatasetError,
    configuration_of_size,
    load_dataset,
    make_dataset,
    random_rig,
    record_calibration,
    save_dataset,
)
from endoscope_core.dataset.calibration_dataset import ARRAYS_FILE, MANIFEST_FILE
from endoscope_core.dataset.rig_variation import GREATEST_EVENNESS, backlash_sizes
from endoscope_core.metrics import width_at_mid_height
from endoscope_core.physics import JointParameters
from endoscope_core.signals import UnknownCalibrationError, calibration_sinusoid


@pytest.fixture(scope='module')
def small():
    return make_dataset(seed=3, per_class=1)


@pytest.mark.parametrize('size_deg', [45.0, 73.0, 102.0])
def test_a_tube_is_found_for_a_wanted_size(size_deg):
    rig = random_rig(np.random.default_rng(int(size_deg)))
    found = configuration_of_size(rig, np.deg2rad(size_deg))
    sizes = np.rad2deg(backlash_sizes(found.plant))
    assert np.mean(sizes) == pytest.approx(size_deg, abs=0.05)
    assert np.rad2deg(found.backlash_size) == pytest.approx(size_deg, abs=0.05)
    assert np.ptp(sizes) < 9.0


def test_no_tube_makes_the_joints_own_friction_vanish():
    assert configuration_of_size(random_rig(np.random.default_rng(0)), np.deg2rad(5.0)) is None


def test_rigs_differ_but_keep_their_gear():
    rigs = [random_rig(np.random.default_rng(seed)) for seed in range(20)]
    frictions = [rig.joints['bend_x'].joint_friction for rig in rigs]
    assert np.std(frictions) > 0.02 * np.mean(frictions)
    for rig in rigs:
        for joint in rig.joints.values():
            assert joint.gear == pytest.approx(JointParameters().gear)
            assert 4.5 < joint.pretension < 5.5


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
    assert np.all(np.abs(np.mean(start, axis=1) - 5.0) < 0.6)
    assert np.all(np.std(np.diff(start, axis=1), axis=1) > 0.01)


def test_tubes_differ_in_how_their_curvature_is_spread(small):
    evenness = [entry['curvature_evenness'] for entry in small.manifest['recordings']]
    assert len(set(evenness)) == 7
    assert 0.0 <= min(evenness) < max(evenness) <= GREATEST_EVENNESS


def test_spread_curvature_changes_the_tensions_of_a_tube_of_the_same_size():
    rig = random_rig(np.random.default_rng(4))
    ends, along = (configuration_of_size(rig, 1.2, evenness) for evenness in (0.0, 1.0))
    first, second = (record_calibration(tube.plant, 1).tension for tube in (ends, along))
    assert np.sqrt(np.mean((first - second) ** 2)) > 0.02


def test_a_brief_calibration_is_of_the_same_tubes(small):
    brief = make_dataset(seed=3, per_class=1, motion='brief')
    assert brief.tension.shape == (7, 3140, 4)
    np.testing.assert_array_equal(brief.joint_size, small.joint_size)
    assert brief.motion == 'brief'


def test_another_seed_of_noise_changes_only_noise():
    plant = random_rig(np.random.default_rng(1))
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
    with pytest.raises(DatasetError, match='is not what'):
        load_dataset(tmp_path / 'data')
    (tmp_path / 'data' / ARRAYS_FILE).write_bytes(b'PK not a zip')
    with pytest.raises(DatasetError, match='cannot be read'):
        load_dataset(tmp_path / 'data')


def test_what_is_no_data_set_is_refused(tmp_path):
    with pytest.raises(DatasetError, match='endoscope dataset'):
        load_dataset(tmp_path)
    with pytest.raises(DatasetError, match='per_class'):
        make_dataset(seed=1, per_class=0)
    with pytest.raises(UnknownCalibrationError, match='nearest is'):
        make_dataset(seed=1, per_class=1, motion='breif')
