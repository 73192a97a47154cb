"""A cheap fit of one more effect, small enough to travel between processes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit import Fit
from endoscope_explain.rank import Look, look
from endoscope_explain.screen import promises, unexplained, with_effect

Array = NDArray[np.float64]

STARTS = 2
"""Starting points of an effect from which it is fitted."""


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


def glance(anchors: tuple[Fit, ...], effects: tuple[str, ...], effect_id: str) -> Glance | None:
    """Cheap fit of one more effect from its best starting points; None where it has none.

    Parameters
    ----------
    anchors : tuple of Fit
        See `rank.look`.
    effects : tuple of str
        Effects that the anchors have.
    effect_id : str
        The one to add.
    """
    found = []
    for promise in promises(unexplained(anchors[0]), effect_id)[:STARTS]:
        item = look(anchors, effects, promise)
        found.append(Glance(effect_id, promise.start, item.theta, item.cost))
    return min(found, key=lambda item: item.cost, default=None)
