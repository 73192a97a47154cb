"""The black boxes' rungs of the ladder: nominal parameters refitted, then the residual learnt."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.compare.black_box.features import motion_features
from endoscope_explain.compare.black_box.regressors import KINDS, trained, training
from endoscope_explain.explanation import ChannelFit
from endoscope_explain.observe.predicted_signals import RecordedView, SignalView
from endoscope_explain.parallel import parallel_map
from endoscope_explain.recording import Recording

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEARNT = ('bending', 'tension', 'shaft_effort', 'shaft_position')
BASE = 'refitted'


@dataclass(frozen=True)
class Exam:
    """What black boxes are trained on, and what they are judged on.

    `use`: training samples of the first recording, by their times.
    `recording`: to judge on.
    `recorded`: with the prediction `BASE`.
    `test`: which of its samples count, by their times.
    """

    use: Callable[[Array], Mask]
    recording: Recording
    recorded: RecordedView
    test: Callable[[Array], Mask]


def black_box_rungs(
    recording: Recording, recorded: RecordedView, exams: Sequence[Exam], jobs: int
) -> list[dict[str, dict[str, ChannelFit]]]:
    """Train both black boxes for each joint and exam, and judge them.

    `recording`: to train on.
    `recorded`: with the prediction `BASE`.
    Returns: for each exam by black box and signal.
    """
    tasks = [(e, kind, j) for e in range(len(exams)) for j in recorded.joints for kind in KINDS]

    def judged(task: tuple[int, str, str]) -> dict[str, ChannelFit]:
        index, kind, joint = task
        return _judged(kind, recording, recorded, exams[index], joint)

    rungs: list[dict[str, dict[str, ChannelFit]]] = [{kind: {} for kind in KINDS} for _ in exams]
    with training():
        answers = parallel_map(judged, tasks, jobs)
    for (index, kind, _), found in zip(tasks, answers, strict=True):
        rungs[index][kind] |= found
    return rungs


def _judged(
    kind: str, recording: Recording, recorded: RecordedView, exam: Exam, joint: str
) -> dict[str, ChannelFit]:
    """One black box for all signals of one joint, judged on each."""
    views = _learnt(recorded, joint)
    bending = next(v for v in views if v.quantity == 'bending')
    time = bending.time[exam.use(bending.time)]
    residuals = np.stack([_averaged(v, time) for v in views], axis=1)
    predict = trained(kind, _features(recording, recorded, joint, time), residuals)
    column = {v.signal: k for k, v in enumerate(views)}
    found = {}
    for one in _learnt(exam.recorded, joint):
        chosen = exam.test(one.time)
        if not chosen.any():
            continue
        features = _features(exam.recording, exam.recorded, joint, one.time[chosen])
        learnt = predict(features)[:, column[one.signal]]
        left = (one.measured - one.predicted[BASE])[chosen] - learnt
        found[one.signal] = ChannelFit.of(left, one.noise[chosen])
    return found


def _features(recording: Recording, recorded: RecordedView, joint: str, at: Array) -> Array:
    order = [joint, *(o for o in recorded.joints if o != joint)]
    columns = [recording.joints.index(name) for name in order]
    angle = recording.command.values[:, columns] / recording.gear
    return motion_features(recording.command.time, angle, at)


def _learnt(recorded: RecordedView, joint: str) -> list[SignalView]:
    return [v for v in recorded.of_joint(joint) if v.quantity in LEARNT]


def _averaged(one: SignalView, time: Array) -> Array:
    """Residual of a signal at slower instants, averaged over the time between them."""
    residual = one.measured - one.predicted[BASE]
    if len(one.time) < 2 * len(time):
        return np.interp(time, one.time, residual)
    half = 0.5 * float(np.median(np.diff(time)))
    cumulative = np.r_[0.0, np.cumsum(residual)]
    first = np.searchsorted(one.time, time - half)
    last = np.maximum(np.searchsorted(one.time, time + half), first + 1)
    last = np.minimum(last, len(residual))
    first = np.minimum(first, last - 1)
    return np.asarray((cumulative[last] - cumulative[first]) / (last - first))
