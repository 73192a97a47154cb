"""Which samples a fit is trained on and which it is judged on.

Whole blocks are held out, the last one among them, with a gap on their borders: neighbours of a
training sample are no test (Roberts et al., Ecography 40, 2017; Burkner et al., J. Stat. Comput.
Simul. 90, 2020).
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCKS = 16
EVERY = 4
"""One block in this many is held out."""
GAP_S = 0.25


def held_out(time: Array, duration: float) -> tuple[Mask, Mask]:
    """Split samples into training and test.

    Parameters
    ----------
    time : array (N,)
        In s from the recording's first stamp.
    duration : float
        Of the recording in s.

    Returns
    -------
    train : array (N,) of bool
    test : array (N,) of bool
        Samples within `GAP_S` of a border between the two are in neither.
    """
    length = duration / BLOCKS
    place = np.clip(time / length, 0.0, BLOCKS - 1e-9)
    block = place.astype(int)
    test = block % EVERY == EVERY - 1
    gap = min(GAP_S / length, 0.25)
    into = place - block
    before_test = (block % EVERY == EVERY - 2) & (into > 1.0 - gap)
    after_test = (block % EVERY == 0) & (block > 0) & (into < gap)
    return ~test & ~before_test & ~after_test, test
