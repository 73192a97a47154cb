"""Corrections by feedback, on their way into commands that come on a beat of their own."""

import numpy as np
from numpy.typing import NDArray


class Corrections:
    """The two newest corrections (J,) in rad; which one a command gets must not depend on chance.

    `fresh_ns` is how old one may be that is still added to a command.
    """

    def __init__(self, fresh_ns: int) -> None:
        self._fresh_ns = fresh_ns
        self._newest: tuple[tuple[int, tuple[float, ...]], ...] = ()

    def restart(self) -> None:
        """Forget them."""
        self._newest = ()

    def add(self, stamp_ns: int, angles: tuple[float, ...]) -> None:
        """Take the next one."""
        self._newest = (*self._newest[-1:], (stamp_ns, angles))

    def before(self, stamp_ns: int) -> NDArray[np.float64] | None:
        """The newest one from before a command of this stamp, unless it is too old."""
        for corrected_ns, angles in reversed(self._newest):
            if corrected_ns < stamp_ns:
                fresh = stamp_ns - corrected_ns <= self._fresh_ns
                return np.array(angles) if fresh else None
        return None
