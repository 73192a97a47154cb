"""The first paper's 1D-CNN that comes with the package, which judges without PyTorch."""

import numpy as np
import pytest
import safetensors.numpy

from endoscope_core.classifier.inference import ClassifierError, TensionClassifier
from endoscope_core.dataset import record_calibration
from endoscope_core.trials.never_seen_tube import never_seen_tube


@pytest.fixture(scope='module')
def classifier():
    return TensionClassifier.load_default()


@pytest.mark.parametrize('class_deg', [40, 70, 100])
def test_it_names_the_class_of_a_tube_it_has_not_seen(classifier, class_deg):
    tube = never_seen_tube(0, class_deg, class_deg)
    result = classifier.classify(record_calibration(tube.plant, seed=5).tension)
    assert result.class_deg == class_deg
    assert result.probability == max(result.probabilities.values())
    assert sum(result.probabilities.values()) == pytest.approx(1.0)
    assert np.rad2deg(result.expected_size) == pytest.approx(class_deg, abs=15.0)


@pytest.mark.parametrize('tension', [np.zeros((8999, 4)), np.zeros((9000, 2)), np.zeros((4, 9000))])
def test_another_shape_is_refused(classifier, tension):
    with pytest.raises(ClassifierError, match='have shape'):
        classifier.classify(tension)


def test_a_broken_sample_is_refused(classifier):
    tension = np.full((9000, 4), 5.0)
    tension[17, 2] = np.nan
    with pytest.raises(ClassifierError, match='not finite'):
        classifier.classify(tension)


def test_missing_or_foreign_weights_are_one_clear_error(tmp_path):
    with pytest.raises(ClassifierError, match='endoscope train'):
        TensionClassifier.load(tmp_path / 'none.safetensors')
    safetensors.numpy.save_file({'dense': np.zeros(1)}, tmp_path / 'odd.safetensors')
    (tmp_path / 'odd.json').write_text('{"schema": 2, "classes_deg": [40], "channels": [8]}')
    with pytest.raises(ClassifierError, match='no classifier weights'):
        TensionClassifier.load(tmp_path / 'odd.safetensors')
    (tmp_path / 'odd.safetensors').write_bytes(b'not weights')
    with pytest.raises(ClassifierError, match='no classifier weights'):
        TensionClassifier.load(tmp_path / 'odd.safetensors')
