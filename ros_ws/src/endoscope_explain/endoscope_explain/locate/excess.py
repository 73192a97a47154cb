"""By how much one prediction misses a signal more than another one does, sample by sample."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.observe.predicted_signals import SignalView, view
from endoscope_explain.recording import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SignalExcess:
    """Excess misfit of one signal."""

    view: SignalView
    # (M,): squared residual without the effect minus that with it, in noise units.
    excess: Array
    kept: Array  # (M,), residual with the effect
    missing: Array  # (M,), what the prediction lacks without the effect, in noise units

    @property
    def total(self) -> float:
        """Return the sum of the excess, at least 0."""
        return max(0.0, float(self.excess.sum()))


def excess_between(
    recording: Recording, without: PlantDescription, with_it: PlantDescription | None
) -> list[SignalExcess]:
    """What two plants, or one plant and noise alone, miss of each signal, largest excess first."""
    plants = {'without': without} if with_it is None else {'without': without, 'with': with_it}
    found = []
    for one in view(recording, plants).signals.values():
        worse = one.residual('without')
        if with_it is None:
            kept, excess, missing = worse, worse**2 - 1.0, worse
        else:
            kept = one.residual('with')
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
