"""Training of the network of the first paper, where PyTorch is installed."""

import numpy as np
import pytest

from endoscope_lab.dataset import CLASSES_DEG, CalibrationDataset

torch = pytest.importorskip('torch', reason='PyTorch is missing: make -C ros_ws train')

from endoscope_lab.papers.networks import (  # noqa: E402
    TrainingSettings,
    cross_validate,
    grouped_folds,
    predict,
    train_network,
    use_one_thread,
)
from endoscope_lab.training.network import TensionCnn  # noqa: E402

SHORT = TrainingSettings(batch_size=14, epochs=60, learning_rate=3e-3, decay=0.97)


@pytest.fixture(scope='module', autouse=True)
def one_thread():
    use_one_thread()


@pytest.fixture(scope='module')
def easy():
    """Two configurations of each class whose tensions differ plainly."""
    generator = np.random.default_rng(0)
    classes = np.repeat(CLASSES_DEG, 4)
    time = np.arange(9000) * 1e-3
    wave = np.sin(time)[:, None] * np.array([1.0, -1.0, 1.0, -1.0])
    noise = generator.normal(0.0, 0.02, (classes.size, 9000, 4))
    tension = (5.0 + 0.05 * classes[:, None, None] * wave + noise).astype(np.float32)
    return CalibrationDataset(
        tension=tension,
        desired_angle=np.sin(time),
        desired_velocity=np.cos(time),
        actual_angle=np.zeros((classes.size, 9000, 2), np.float32),
        class_deg=classes,
        joint_size=np.deg2rad(np.stack([classes, classes], axis=1)),
        configuration=np.arange(classes.size) // 2,
        manifest={'seed': 0, 'per_class': 4, 'motion': 'sinusoid'},
    )


def test_table_2_reduces_a_recording_to_one_feature_vector():
    network = TensionCnn(7).eval()
    convolutions = [m for m in network.modules() if isinstance(m, torch.nn.Conv1d)]
    assert [(c.kernel_size, c.stride) for c in convolutions] == [((3,), (3,))] * 8
    assert network.features(torch.zeros(1, 4, 9000)).shape == (1, 64, 1)
    names = [type(m).__name__ for m in network.features]
    assert names == ['Conv1d', 'BatchNorm1d', 'ReLU'] * 8
    assert isinstance(network.dense, torch.nn.Linear)


def test_training_learns_and_repeats_with_its_seed(easy):
    first = train_network(easy.tension, easy.class_deg, 1, SHORT)
    again = train_network(easy.tension, easy.class_deg, 1, SHORT)
    for one, other in zip(first.parameters(), again.parameters(), strict=True):
        assert torch.equal(one, other)
    likeliest = np.array(CLASSES_DEG)[np.argmax(predict(first, easy.tension), axis=1)]
    assert np.mean(np.abs(likeliest - easy.class_deg)) < 6.0


def test_folds_never_split_a_configuration(easy, monkeypatch):
    trained_with = []

    def remember(tension, class_deg, seed):
        trained_with.append(tension)
        return TensionCnn(len(CLASSES_DEG)).eval()

    monkeypatch.setattr('endoscope_lab.papers.networks.train_network', remember)
    result = cross_validate(easy, seed=0, folds=2)
    assert result.confusion.sum() == len(easy.class_deg)
    for tension in trained_with:
        rows = [k for k, t in enumerate(easy.tension) if any(np.array_equal(t, x) for x in tension)]
        inside = set(easy.configuration[rows].tolist())
        assert all(np.sum(easy.configuration[rows] == c) == 2 for c in inside)


def test_folds_keep_a_configuration_on_one_side(easy):
    for train, test in grouped_folds(easy, 0, 2):
        assert not set(easy.configuration[train]) & set(easy.configuration[test])
        assert len(train) + len(test) == len(easy.class_deg)
