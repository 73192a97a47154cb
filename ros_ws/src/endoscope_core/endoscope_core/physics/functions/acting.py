"""Whether a plant has a function at any place: what its flags are made of says so.

Tests of the functions' flags, or of one flag for all, cost the plant that has none of them a tenth
of its speed, since compiled code is laid out for both cases. So the flags of a plant with functions
are bytes instead of truth values. Numba compiles it apart from the one without, at its first use,
and the one without holds nothing of them.
"""

from typing import Any

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

FLAGS_OF_FUNCTIONS = np.int8
"""Kind of the flags of a plant with functions."""
ADDS, MULTIPLIES = 1, 2
"""Flags of a function that is a term of its own, and of one that multiplies the others."""


def functions_act(on: NDArray[Any]) -> bool:
    """Whether a plant with these flags has functions; a constant in compiled code."""
    return on.dtype == FLAGS_OF_FUNCTIONS


@overload(functions_act)
def _functions_act(on: Any) -> Any:
    def yes(on: Any) -> bool:
        return True

    def no(on: Any) -> bool:
        return False

    return yes if on.dtype == types.int8 else no
