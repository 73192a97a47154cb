"""The 1D-CNN of Table 2 of the first paper in PyTorch, and the common part of its networks.

Only training needs PyTorch; without it, importing this module raises a line on how to install it.
"""

from itertools import pairwise

import numpy as np

from endoscope_core.classifier.classification import WIRE_COUNT
from endoscope_core.classifier.cnn_classifier import CHANNELS, STRIDE
from endoscope_core.errors import EndoscopeError

try:
    import torch
    from torch import Tensor, nn
except ModuleNotFoundError as error:
    raise EndoscopeError(
        'training the networks of the first paper needs PyTorch: run `make -C ros_ws train`, '
        'which reports its size'
    ) from error


class StandardisedTension(nn.Module):
    """A network whose input is standardised, wire by wire, by the training data."""

    offset: Tensor  # (4, 1) in N, like `scale` kept with the weights
    scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer('offset', torch.zeros(WIRE_COUNT, 1))
        self.register_buffer('scale', torch.ones(WIRE_COUNT, 1))

    def standardise_by(self, tension: Tensor) -> None:
        """Take mean and standard deviation of each wire over recordings (R, 4, N) as the unit."""
        self.offset = tension.mean(dim=(0, 2)).unsqueeze(1)
        self.scale = tension.std(dim=(0, 2)).unsqueeze(1)

    def unitless(self, tension: Tensor) -> Tensor:
        """Tensions (R, 4, N) in N by that unit."""
        return (tension - self.offset) / self.scale


class TensionCnn(StandardisedTension):
    """Eight convolutions with batch normalisation and ReLU, then a dense layer of `outputs` logits.

    Eight unpadded strides of three reduce 6,561 samples to exactly one, so that of 9,000 samples
    the last 2,439 are not used. The loss applies softmax in training, otherwise the caller does.
    """

    def __init__(self, outputs: int) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for width, wider in pairwise((WIRE_COUNT, *CHANNELS)):
            layers += [nn.Conv1d(width, wider, STRIDE, STRIDE), nn.BatchNorm1d(wider), nn.ReLU()]
        self.features = nn.Sequential(*layers)
        self.dense = nn.Linear(CHANNELS[-1], outputs)

    def forward(self, tension: Tensor) -> Tensor:
        """Outputs (R, O) of tensions, or their courses, (R, 4, N)."""
        features = self.features(self.unitless(tension))
        logits: Tensor = self.dense(features.flatten(1))
        return logits

    def weights(self) -> dict[str, np.ndarray]:
        """Weights for `evaluated`, with each normalisation folded into its convolution."""
        state = {name: value.double().numpy() for name, value in self.state_dict().items()}
        found = {'offset': state['offset'][:, 0], 'scale': state['scale'][:, 0]}
        for k in range(len(CHANNELS)):
            own, norm = f'features.{3 * k}.', f'features.{3 * k + 1}.'
            spread = np.sqrt(state[norm + 'running_var'] + self.features[3 * k + 1].eps)
            gain = state[norm + 'weight'] / spread
            # Rows in the order of samples, then channels.
            rows = state[own + 'weight'].transpose(2, 1, 0).reshape(-1, len(gain))
            found[f'filter.{k}'] = rows * gain
            shift = state[own + 'bias'] - state[norm + 'running_mean']
            found[f'bias.{k}'] = shift * gain + state[norm + 'bias']
        found |= {'dense': state['dense.weight'].T, 'bias': state['dense.bias']}
        return {name: np.ascontiguousarray(x, dtype=np.float32) for name, x in found.items()}
