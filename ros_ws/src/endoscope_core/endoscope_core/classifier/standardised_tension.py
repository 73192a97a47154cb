"""The unit in which a network of the first paper sees tensions."""

from endoscope_core.classifier.classification import WIRES
from endoscope_core.classifier.pytorch import Tensor, nn, torch


class StandardisedTension(nn.Module):
    """A network that sees each wire by mean and spread of what it is trained on."""

    offset: Tensor  # (4, 1) in N, like `scale` kept with the weights
    scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer('offset', torch.zeros(WIRES, 1))
        self.register_buffer('scale', torch.ones(WIRES, 1))

    def standardise_by(self, tension: Tensor) -> None:
        """Take mean and spread of each wire over recordings (R, 4, N) as the unit of the input."""
        self.offset = tension.mean(dim=(0, 2)).unsqueeze(1)
        self.scale = tension.std(dim=(0, 2)).unsqueeze(1)

    def unitless(self, tension: Tensor) -> Tensor:
        """Tensions (R, 4, N) in N by that unit."""
        return (tension - self.offset) / self.scale
