"""Black boxes that learn what the refitted plant leaves: what prediction alone can reach."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from endoscope_core.workers import parallel_map
from endoscope_explain.explanation import ChannelFit
from endoscope_explain.observe.predicted_signals import RecordedView, SignalView
from endoscope_explain.recording import Recording

Array = NDArray[np.float64]
Predictor = Callable[[Array], Array]
"""Outputs (M, K) of features (M, F)."""

GAUSSIAN_PROCESS_POINTS = 500
TUNING_POINTS = 150
NETWORK_WIDTH = 32
NETWORK_STEPS = 500
NETWORK_DECAY = 2e-2
"""Weight of the squared weights: of 1e-4 to 3e-2 what leaves least in held-out blocks."""
EDGE = 4.0
"""Beyond so many standard deviations a black box knows nothing: it stays at the edge."""


def trained(kind: str, features: Array, outputs: Array) -> Predictor:
    """Train a black box of `KINDS` on features (M, F) and outputs (M, K)."""
    from sklearn.preprocessing import StandardScaler

    inputs, targets = StandardScaler().fit(features), StandardScaler().fit(outputs)

    def scaled(features: Array) -> Array:
        return np.clip(inputs.transform(features), -EDGE, EDGE)

    model = KINDS[kind](scaled(features), targets.transform(outputs))

    def predict(features: Array) -> Array:
        found = np.asarray(model.predict(scaled(features))).reshape(len(features), -1)
        return np.asarray(targets.inverse_transform(found))

    return predict


@contextmanager
def training() -> Iterator[None]:
    """What black boxes are trained in, side by side or one after the other."""
    from sklearn.exceptions import ConvergenceWarning
    from threadpoolctl import threadpool_limits

    # Matrices this small are slower on several threads than on one.
    with warnings.catch_warnings(), threadpool_limits(1):
        # A length scale at its bound is a feature that does not matter, and so many steps of the
        # network are meant.
        warnings.simplefilter('ignore', ConvergenceWarning)
        yield


def _gaussian_process(x: Array, y: Array) -> Any:
    """One length scale for each feature, on an even subsample."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, WhiteKernel

    # The length scales are tuned by marginal likelihood on a coarser subsample still; Rasmussen,
    # Williams, Gaussian Processes for Machine Learning, 2006, ch. 5.
    few, many = (
        np.linspace(0, len(x) - 1, min(count, len(x))).astype(int)
        for count in (TUNING_POINTS, GAUSSIAN_PROCESS_POINTS)
    )
    kernel = RBF(np.full(x.shape[1], 3.0), (0.1, 1e3)) + WhiteKernel(0.1, (1e-3, 2.0))
    tuning = GaussianProcessRegressor(kernel, optimizer=_few_steps).fit(x[few], y[few])
    return GaussianProcessRegressor(tuning.kernel_, optimizer=None).fit(x[many], y[many])


def _few_steps(objective: object, start: Array, bounds: Array) -> tuple[Array, float]:
    from scipy.optimize import minimize

    found = minimize(
        objective, start, jac=True, bounds=bounds, method='L-BFGS-B', options={'maxiter': 10}
    )
    return found.x, found.fun


def _neural_network(x: Array, y: Array) -> Any:
    """Two hidden layers of tanh, trained by Adam with weight decay on all samples."""
    from sklearn.neural_network import MLPRegressor

    return MLPRegressor(
        hidden_layer_sizes=(NETWORK_WIDTH, NETWORK_WIDTH),
        activation='tanh',
        alpha=NETWORK_DECAY * len(x),
        batch_size=len(x),
        learning_rate_init=1e-2,
        max_iter=NETWORK_STEPS,
        n_iter_no_change=NETWORK_STEPS,
        random_state=0,
    ).fit(x, y)


KINDS: Mapping[str, Callable[[Array, Array], Any]] = {
    'gaussian_process': _gaussian_process,
    'neural_network': _neural_network,
}
"""Black boxes by name: each fits scaled features (M, F) and outputs (M, K)."""


Mask = NDArray[np.bool_]

LEARNT = ('bending', 'tension', 'shaft_effort', 'shaft_position')
BASE = 'refitted'
GRID_S = 0.01
PLAY_WIDTHS = (0.1, 0.3, 0.6, 1.0)
"""Full widths in rad of play operators, the memory of hysteresis."""
LAGS_S = (0.05, 0.3, 2.0)
"""Time constants of low passes, the memory of rates."""


def motion_features(time: Array, angle: Array, at: Array) -> Array:
    """Motion (M, J * 9) by commands (N, J) in rad alone, the joint of interest first."""
    grid = np.arange(min(time[0], at.min()), max(time[-1], at.max()) + GRID_S, GRID_S)
    columns = []
    for j in range(angle.shape[1]):
        u = np.interp(grid, time, angle[:, j])
        columns += [u, np.gradient(u, GRID_S), *_plays(u).T, *(_lagging(u, lag) for lag in LAGS_S)]
    return np.stack([np.interp(at, grid, c) for c in columns], axis=1)


def _plays(u: Array) -> Array:
    half = 0.5 * np.array(PLAY_WIDTHS)
    out = np.empty((len(u), len(half)))
    position = np.full(len(half), u[0])
    for i, value in enumerate(u):
        position = np.clip(position, value - half, value + half)
        out[i] = position
    return out


def _lagging(u: Array, lag: float) -> Array:
    share = 1.0 - np.exp(-GRID_S / lag)
    filtered, _ = lfilter([share], [1.0, share - 1.0], u, zi=[(1.0 - share) * u[0]])
    return np.asarray(filtered)


@dataclass(frozen=True)
class Exam:
    """What black boxes are trained on, and what they are judged on."""

    use: Callable[[Array], Mask]  # training samples of the first recording, by their times
    recording: Recording  # to judge on
    recorded: RecordedView  # with the prediction `BASE`
    test: Callable[[Array], Mask]  # which of its samples count, by their times


def black_box_fits(
    recording: Recording, recorded: RecordedView, exams: Sequence[Exam], jobs: int
) -> list[dict[str, dict[str, ChannelFit]]]:
    """Train both black boxes for each joint and exam; judged, for each exam, by box and signal."""
    tasks = [(e, kind, j) for e in range(len(exams)) for j in recorded.joints for kind in KINDS]

    def judged(task: tuple[int, str, str]) -> dict[str, ChannelFit]:
        index, kind, joint = task
        return _judged(kind, recording, recorded, exams[index], joint)

    compared: list[dict[str, dict[str, ChannelFit]]] = [{kind: {} for kind in KINDS} for _ in exams]
    with training():
        answers = parallel_map(judged, tasks, jobs)
    for (index, kind, _), found in zip(tasks, answers, strict=True):
        compared[index][kind] |= found
    return compared


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
