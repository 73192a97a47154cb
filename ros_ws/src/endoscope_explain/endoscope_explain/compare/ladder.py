"""The ladder of fits: nominal, refitted and augmented plant beside two black boxes."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.case import Ladder
from endoscope_explain.compare.black_box.models import Exam, black_box_fits
from endoscope_explain.explanation import ChannelFit, Explanation
from endoscope_explain.fit.held_out import fitted_at, judged_at
from endoscope_explain.observe.predicted_signals import fits_by, view
from endoscope_explain.recording import Recording

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

PHYSICS = ('nominal', 'refitted', 'augmented')


def ladders(
    recording: Recording,
    explanation: Explanation,
    validation: Recording | None,
    black_boxes: bool,
    jobs: int,
) -> tuple[Ladder, Ladder]:
    """Judge all fits, on held-out blocks and on a second recording, if there is one."""
    plants = {name: getattr(explanation, name) for name in PHYSICS}
    held_out: dict[str, Mapping[str, ChannelFit]] = {
        name: dict(explanation.fit.get(name, {})) for name in PHYSICS
    }
    second: dict[str, Mapping[str, ChannelFit]] = {}
    if not held_out['nominal']:
        return held_out, second
    seen = None if validation is None else view(validation, plants)
    if seen is not None:
        second = {name: fits_by(seen, name) for name in PHYSICS}
    if black_boxes:
        recorded = view(recording, plants)
        blocks = Exam(
            lambda t: fitted_at(t - recorded.begin),
            recording,
            recorded,
            lambda t: judged_at(t - recorded.begin),
        )
        exams = [blocks]
        if validation is not None and seen is not None:
            # The black boxes see all of the first recording before they are judged on the second
            # one.
            exams.append(Exam(_all, validation, seen, _all))
        compared = black_box_fits(recording, recorded, exams, jobs)
        for ladder, found in zip((held_out, second), compared, strict=False):
            ladder.update(found)
    return held_out, second


def _all(time: Array) -> Mask:
    return np.ones(len(time), bool)
