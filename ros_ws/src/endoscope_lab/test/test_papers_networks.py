"""The network of the first paper, where PyTorch is installed."""

import numpy as np
import pytest

from endoscope_lab.dataset import CLASSES_DEG, CalibrationDataset

torch = pytest.importorskip('torch', reason='PyTorch is missing: make -C ros_ws train')

from endoscope_lab.papers.networks import grouped_folds  # noqa: E402
from endoscope_lab.training.network import TensionCnn  # noqa: E402


def test_table_2_reduces_a_recording_to_one_feature_vector():
    network = TensionCnn(7).eval()
    convolutions = [m for m in network.modules() if isinstance(m, torch.nn.Conv1d)]
    assert [(c.kernel_size, c.stride) for c in convolutions] == [((3,), (3,))] * 8
    assert network.features(torch.zeros(1, 4, 9000)).shape == (1, 64, 1)
    names = [type(m).__name__ for m in network.features]
    assert names == ['Conv1d', 'BatchNorm1d', 'ReLU'] * 8
    assert isinstance(network.dense, torch.nn.Linear)


def test_folds_keep_a_configuration_on_one_side():
    classes = np.repeat(CLASSES_DEG, 4)
    nothing = np.zeros((classes.size, 1, 4), np.float32)
    pairs = np.arange(classes.size) // 2
    dataset = CalibrationDataset(nothing, *[nothing[0]] * 2, nothing, classes, nothing, pairs, {})
    for train, test in grouped_folds(dataset, 0, 2):
        assert not set(pairs[train]) & set(pairs[test])
        assert sorted((*train, *test)) == list(range(classes.size))
