"""How the inner loops of this package are compiled."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.compiled_cache import njit

Array = NDArray[np.float64]
Flags = NDArray[Any]
"""Truth values of what is on; bytes where a plant has functions as well as effects."""

_OPTIONS: dict[str, Any] = {'cache': True, 'error_model': 'numpy', 'nogil': True, '_nrt': False}
compiled: Callable[[Callable[..., Any]], Callable[..., Any]] = njit(**_OPTIONS)
"""Decorator for physics on arrays that the caller made.

Compiled functions here allocate nothing, so numba need not count references to their arrays; the
counting, at every call of every effect, would take four times as long as the physics. Division by
zero gives an infinity instead of an exception.
"""
