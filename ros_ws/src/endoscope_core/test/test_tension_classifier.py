"""The first paper's 1D-CNN that comes with the package, which judges without PyTorch."""

import numpy as np
import pytest
import safetensors.numpy

from endoscope_core.classifier.inference import ClassifierError, TensionClassifier


@pytest.fixture(scope='module')
def classifier():
    return TensionClassifier.load_default()


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
