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


def test_an_instrument_that_the_most_bent_tube_holds_is_drawn_again():
    held = random_instrument(np.random.default_rng(4), widening=1.8)
    assert configuration_of_size(held, np.deg2rad(70.0), -GREATEST_UNEVENNESS) is None


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


@pytest.mark.nightly
def test_a_brief_calibration_is_of_the_same_tubes(small):
    brief = make_dataset(seed=3, per_class=1, motion='brief')
    assert brief.tension.shape == (7, 3140, 4)
    np.testing.assert_array_equal(brief.joint_size, small.joint_size)
    assert brief.motion == 'brief'


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
