"""Training of the networks of the first paper, where PyTorch is installed."""

import numpy as np
import pytest

from endoscope_core.classifier.cnn_classifier import INPUT, evaluated
from endoscope_core.classifier.grouped_folds import grouped_folds
from endoscope_core.dataset import CLASSES_DEG, CalibrationDataset

torch = pytest.importorskip('torch', reason='PyTorch is missing: make -C ros_ws train')

from endoscope_core.classifier.cnn_training import CnnTraining, loss_of, train_cnn  # noqa: E402
from endoscope_core.classifier.recurrence_plot_cnn import PIXELS, recurrence_plots  # noqa: E402
from endoscope_core.classifier.tension_cnn import TensionCnn  # noqa: E402
from endoscope_core.classifier.training import (  # noqa: E402
    NETWORKS,
    TrainingSettings,
    cross_validate,
    predict,
    train_network,
    use_one_thread,
)

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


@pytest.mark.parametrize('kind', ['mlp', 'recurrence_plot_cnn'])
def test_the_networks_compared_with_learn_too(easy, kind):
    settings = TrainingSettings(batch_size=14, epochs=50, learning_rate=1e-3, decay=0.98)
    network = train_network(easy.tension, easy.class_deg, 1, settings, kind)
    likeliest = np.array(CLASSES_DEG)[np.argmax(predict(network, easy.tension), axis=1)]
    assert np.mean(np.abs(likeliest - easy.class_deg)) < 6.0
    assert type(network) is NETWORKS[kind]


def test_a_recurrence_plot_is_the_distance_of_every_two_states():
    tension = torch.from_numpy(np.linspace(2.0, 8.0, 9000)).float().expand(1, 4, 9000)
    plots = recurrence_plots(tension)
    states = tension[0, 0].reshape(PIXELS, -1).mean(dim=1)
    assert plots.shape == (1, 4, PIXELS, PIXELS)
    assert plots[0, 2, 7, 30] == pytest.approx(float(states[30] - states[7]), abs=1e-5)
    assert torch.equal(plots, plots.transpose(2, 3))


def test_training_learns_and_repeats_with_its_seed(easy):
    first = train_network(easy.tension, easy.class_deg, 1, SHORT)
    again = train_network(easy.tension, easy.class_deg, 1, SHORT)
    for one, other in zip(first.parameters(), again.parameters(), strict=True):
        assert torch.equal(one, other)
    likeliest = np.array(CLASSES_DEG)[np.argmax(predict(first, easy.tension), axis=1)]
    assert np.mean(np.abs(likeliest - easy.class_deg)) < 6.0


def test_folds_never_split_a_configuration(easy, monkeypatch):
    from endoscope_core.classifier import training

    trained_with = []

    def remember(tension, class_deg, seed, settings, kind):
        trained_with.append(tension)
        return TensionCnn(len(CLASSES_DEG)).eval()

    monkeypatch.setattr(training, 'train_network', remember)
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


def test_an_interrupted_training_goes_on_to_the_same_weights(tmp_path, monkeypatch):
    from endoscope_core.classifier import cnn_training

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
    assert 'goes on after step 2 of 4' in lines
    for name, array in whole.classifier.weights.items():
        np.testing.assert_array_equal(array, again.classifier.weights[name])
    assert whole.classifier.calibration == again.classifier.calibration
    assert [step for step, _ in again.curve] == [2, 4]
