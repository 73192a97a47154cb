"""Watches wire tensions against a ceiling."""

import math
from collections.abc import Sequence

RELEASE = 0.9


class TensionGuard:
    """Says when a wire is pulled too hard.

    A wire is over the ceiling once ``samples`` readings in a row are: a single spike of a load cell
    is not a tension.  A reading that is not a number counts as over the ceiling, for it hides one.
    That is over only at nine tenths of the ceiling, for readings that scatter about the ceiling are
    still of a wire that is pulled too hard.

    Parameters
    ----------
    names
        The W wires.
    ceiling
        In N.
    samples
        How many readings in a row it takes, and how many below to say that it is over.
    """

    def __init__(self, names: Sequence[str], ceiling: float, samples: int = 3) -> None:
        self._names = tuple(names)
        self._ceiling = ceiling
        self._samples = samples
        self._run = [0] * len(self._names)
        self._clear = 0
        self.peak = 0.0
        self.trouble = ''

    def update(self, tension: Sequence[float]) -> str:
        """Take one reading of all wires, in N, shape (W,).

        Returns
        -------
        str
            What is wrong, naming the wire; empty while all is well.
        """
        high = False
        low = max(tension, default=0.0) <= RELEASE * self._ceiling
        for wire, value in enumerate(tension):
            if math.isfinite(value) and value <= self._ceiling:
                if value > self.peak:
                    self.peak = value
                self._run[wire] = 0
                continue
            high = True
            self._run[wire] += 1
            if math.isfinite(value):
                self.peak = max(self.peak, value)
            if self._run[wire] >= self._samples and not self.trouble:
                self.trouble = (
                    f'tension of {self._names[wire]} is {value:.1f} N, '
                    f'over the ceiling of {self._ceiling:.1f} N'
                )
        if self.trouble:
            self._clear = self._clear + 1 if low and not high else 0
            if self._clear >= self._samples:
                self.trouble = ''
                self._clear = 0
        return self.trouble
