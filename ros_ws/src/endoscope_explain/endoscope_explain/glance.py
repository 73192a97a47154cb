"""A cheap fit of one more effect, small enough to travel between processes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit.model import Fit
from endoscope_explain.rank import Look, look
from endoscope_explain.screen import Promise, with_effect

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Glance:
    """A cheap fit without the recording that it was made on.

    Attributes
    ----------
    effect_id : str
        The effect that was added.
    start : dict of str to float
        Parameters from which it was fitted.
    theta : array (n,)
    cost : float
    """

    effect_id: str
    start: dict[str, float]
    theta: Array
    cost: float

    def look(self, anchors: tuple[Fit, ...], effects: tuple[str, ...]) -> Look:
        """The look at the anchors, with these effects, that this was."""
        model = with_effect(anchors[0].model, self.effect_id, self.start)
        return Look((*effects, self.effect_id), model, self.theta, self.cost)


def glance(anchors: tuple[Fit, ...], effects: tuple[str, ...], promise: Promise) -> Glance:
    """Cheap fit of one more effect from one starting point; arguments as in `rank.look`."""
    item = look(anchors, effects, promise)
    return Glance(promise.effect_id, promise.start, item.theta, item.cost)
