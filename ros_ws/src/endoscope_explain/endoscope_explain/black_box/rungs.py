"""The black boxes' rungs of the ladder: nominal parameters refitted, then the residual learnt."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.black_box.features import motion_features
from endoscope_explain.black_box.regressors import GaussianProcess, NeuralNetwork, Regressor
from endoscope_explain.explanation import ChannelFit
from endoscope_explain.predicted_signals import RecordedView, SignalView
from endoscope_explain.recording import Recording

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

KINDS: Mapping[str, Callable[[Array, Array], Regressor]] = {
    'gaussian_process': GaussianProcess,
    'neural_network': NeuralNetwork,
}
LEARNT = ('bending', 'tension', 'shaft_effort', 'shaft_position')
BASE = 'refitted'


class ResidualModel:
    """One black box for all signals of one joint.

    Parameters
    ----------
    kind : str
        A key of `KINDS`.
    recording : Recording
    recorded : RecordedView
        With the prediction `BASE`.
    joint : str
    use : callable
        Which samples to train on, by their times.
    """

    def __init__(
        self,
        kind: str,
        recording: Recording,
        recorded: RecordedView,
        joint: str,
        use: Callable[[Array], Mask],
    ) -> None:
        self._joint = joint
        views = _learnt(recorded, joint)
        bending = next(v for v in views if v.quantity == 'bending')
        time = bending.time[use(bending.time)]
        residuals = np.stack([_averaged(v, time) for v in views], axis=1)
        self._signals = [v.signal for v in views]
        self._model = KINDS[kind](self._features(recording, recorded, time), residuals)

    def correction(
        self, recording: Recording, recorded: RecordedView, signal: str, time: Array
    ) -> Array:
        """Return the learnt residual of a signal at some times, in the signal's unit."""
        predicted = self._model.predict(self._features(recording, recorded, time))
        return predicted[:, self._signals.index(signal)]

    def _features(self, recording: Recording, recorded: RecordedView, at: Array) -> Array:
        order = [self._joint, *(o for o in recorded.joints if o != self._joint)]
        columns = [recording.joints.index(name) for name in order]
        angle = 2.0 * recording.command.values[:, columns]
        return motion_features(recording.command.time, angle, at)


def black_box_rungs(
    recording: Recording,
    recorded: RecordedView,
    use: Callable[[Array], Mask],
    judged: Mapping[str, tuple[Recording, RecordedView, Callable[[Array], Mask]]],
) -> dict[str, dict[str, dict[str, ChannelFit]]]:
    """Train both black boxes and judge them.

    Parameters
    ----------
    recording : Recording
    recorded : RecordedView
        With the prediction `BASE`.
    use : callable
        Training samples by their times.
    judged : mapping of str to (Recording, RecordedView, callable)
        What to judge on, and on which samples.

    Returns
    -------
    dict
        By name of what was judged on, black box and signal.
    """
    rungs: dict[str, dict[str, dict[str, ChannelFit]]] = {
        name: {kind: {} for kind in KINDS} for name in judged
    }
    for joint in recorded.joints:
        for kind in KINDS:
            model = ResidualModel(kind, recording, recorded, joint, use)
            for name, (other, seen, test) in judged.items():
                for one in _learnt(seen, joint):
                    chosen = test(one.time)
                    if not chosen.any():
                        continue
                    correction = model.correction(other, seen, one.signal, one.time[chosen])
                    left = (one.measured - one.predicted[BASE])[chosen] - correction
                    rungs[name][kind][one.signal] = ChannelFit(
                        float(np.sqrt(np.mean(left**2))),
                        float(np.sqrt(np.mean(one.noise[chosen] ** 2))),
                    )
    return rungs


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
