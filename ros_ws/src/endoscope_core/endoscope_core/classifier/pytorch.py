"""PyTorch, which only the training of networks needs, or one line that says how to get it."""

from endoscope_core.errors import EndoscopeError

try:
    import torch
    from torch import Tensor, nn
except ModuleNotFoundError as error:
    raise EndoscopeError(
        'training the networks of the first paper needs PyTorch: run `make -C ros_ws train`, '
        'which says how large it is'
    ) from error

__all__ = ['Tensor', 'nn', 'torch']
