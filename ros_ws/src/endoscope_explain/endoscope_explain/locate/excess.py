"""By how much one prediction misses a signal more than another one does, sample by sample."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.observe.predicted_signals import SignalView

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SignalExcess:
    """Excess misfit of one signal.

    Attributes
    ----------
    view : SignalView
    excess : array (M,)
        Squared residual without the effect minus that with it, in noise units.
    kept : array (M,)
        Residual with the effect.
    missing : array (M,)
        What the prediction lacks without the effect, in noise units.
    """

    view: SignalView
    excess: Array
    kept: Array
    missing: Array

    @property
    def total(self) -> float:
        """Return the sum of the excess, at least 0."""
        return max(0.0, float(self.excess.sum()))


def excess_between(
    views: Sequence[SignalView], without: str, with_it: str | None
) -> list[SignalExcess]:
    """Compare two predictions of each signal.

    Parameters
    ----------
    views : sequence of SignalView
    without, with_it : str
        Names of the predictions; `with_it` None stands for noise alone.

    Returns
    -------
    list of SignalExcess
        Largest total first.
    """
    found = []
    for one in views:
        worse = one.residual(without)
        if with_it is None:
            kept = worse
            excess, missing = worse**2 - 1.0, worse
        else:
            kept = one.residual(with_it)
            excess, missing = worse**2 - kept**2, worse - kept
        found.append(SignalExcess(one, excess, kept, missing))
    return sorted(found, key=lambda e: -e.total)


def shares(excesses: Sequence[SignalExcess], least: float = 0.03) -> dict[str, float]:
    """Share of the whole excess of each signal, largest first, those below `least` left out."""
    total = sum(e.total for e in excesses)
    if total <= 0.0:
        return {}
    every = {e.view.signal: e.total / total for e in excesses}
    return {signal: share for signal, share in every.items() if share >= least}
