"""Training of the classifier, where PyTorch is installed."""

import numpy as np
import pytest

from endoscope_core.classifier.cnn_classifier import INPUT, evaluated

torch = pytest.importorskip('torch', reason='PyTorch is missing: make -C ros_ws train')

from endoscope_lab.training.cnn_training import CnnTraining, loss_of, train_cnn  # noqa: E402
from endoscope_lab.training.network import TensionCnn  # noqa: E402


def test_judging_without_pytorch_gives_what_pytorch_gives():
    torch.manual_seed(0)
    network = TensionCnn(10)
    courses = torch.randn(16, 4, INPUT)
    network.standardise_by(courses)
    network(courses)
    network.eval()
    expected = network(courses).detach().numpy()
    found, features = evaluated(network.weights(), courses.transpose(1, 2).numpy())
    assert features.shape == (16, 64)
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_the_loss_is_least_for_the_truth():
    size = torch.deg2rad(torch.tensor([70.0, float('nan')]))
    right = torch.full((2, 10), -9.0)
    right[0, 3], right[0, 7], right[1, 9] = 9.0, 0.0, 9.0
    for column, value in ((7, 1.0), (9, 3.0), (3, -9.0)):
        wrong = right.clone()
        wrong[0, column] = value
        for warm in (True, False):
            assert loss_of(wrong, size, 0.02, warm) > loss_of(right, size, 0.02, warm) + 0.5


def test_an_interrupted_training_resumes_to_the_same_weights(tmp_path, monkeypatch):
    from endoscope_lab.training import cnn_training

    monkeypatch.setattr(cnn_training, 'KEPT_EVERY', 2)
    settings = CnnTraining(rigs=6, strange=3, held_out=6, steps=4, batch=8, warm_up=2)
    whole = train_cnn('sinusoid', 3, settings)
    kept, lines = tmp_path / 'part', []

    def interrupt(line):
        if line.startswith('step 2'):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_cnn('sinusoid', 3, settings, kept, interrupt)
    again = train_cnn('sinusoid', 3, settings, kept, lines.append)
    assert 'resumes after step 2 of 4' in lines
    for name, array in whole.classifier.weights.items():
        np.testing.assert_array_equal(array, again.classifier.weights[name])
    assert whole.classifier.calibration == again.classifier.calibration
    assert [step for step, _ in again.curve] == [2, 4]
