"""Names the class of a tube by the first paper's 1D-CNN, of which a file holds the weights."""

import json
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, fields
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from statistics import NormalDist
from typing import Annotated, Any

import numpy as np
import safetensors.numpy
from msgspec import Meta
from numpy.typing import ArrayLike, DTypeLike, NDArray
from safetensors import SafetensorError

from endoscope_core.classifier.classification import (
    HALF_CLASS,
    LEVEL,
    WIRE_COUNT,
    ClassificationResult,
    ClassifierError,
    UnseenTensionError,
    checked_tension,
    of_size,
)
from endoscope_core.schema import read, within
from endoscope_core.signals import SINUSOID, calibration_motion

Array = NDArray[np.float64]
Single = NDArray[np.float32]

STRIDE = 3
"""Step and width of each convolution."""
CHANNELS = (16, 16, 32, 32, 64, 64, 64, 64)
"""Outputs of the eight convolutions, which the paper does not give."""
INPUT = STRIDE ** len(CHANNELS)
"""Samples that eight unpadded strides of three reduce to exactly one."""
SLACK = 0.5
"""Tension in N that is added before the logarithm, which a slack wire has none of."""
MIDDLE, UNIT = math.radians(70.0), math.radians(20.0)
"""The size is an output in these units."""
LEAST_DEVIATION = math.radians(0.1)
LARGEST_GAP = 0.3
"""In N: three standard deviations of the zero errors that the training has at most."""
KNOWN = 0.995
"""Share of known tubes that are not to be refused."""
OWN_OUTPUTS = 3
"""After the classes: size, logarithm of its deviation, and logit of 'none of these'."""
_NORMAL = NormalDist()

_OPEN = (
    'a tension is {:.1f} N another at the end of a whole period than at its start: a load cell '
    'drifts, or the motion was another'
)
_NONE = 'the tensions are what disturbed cells or another motion give'
_FAR = 'the tensions are too far from those of all known tubes'

SCHEMA = 5
SEAL = 'sha256'
LARGEST_WEIGHTS, LARGEST_DESCRIPTION = 16 << 20, 1 << 20
"""In bytes. The largest that come with this package have 218 kB and 3 kB."""
_Positive = Annotated[float, Meta(gt=0.0, le=sys.float_info.max, description='a positive number')]


@dataclass(frozen=True)
class HeldOutCalibration:
    """What rigs held out from the training say of the network."""

    inflation: float  # half the width of an interval, in the network's standard deviations
    # Distance of the features, and probability of 'none of these', up to which tensions are those
    # of known tubes.
    ceiling: float
    doubt: float


@dataclass(frozen=True)
class Estimates:
    """What the network makes of R recordings; all arrays (R,)."""

    size: Array  # backlash size in rad, mean of the joints
    # Of the error of `size` in rad, as the network takes it: before calibration on rigs held out.
    deviation: Array
    # Probability that the tensions are of no tube but of disturbed cells or another motion.
    none: Array
    distance: Array  # of the features from those of the training (Mahalanobis)
    gap: Array  # by which the loop of a wire fails to close, N: the greatest of the wires


def course(tension: ArrayLike, motion: str) -> Single:
    """What the network reads of recordings (..., N, 4) in N at 1 kHz: (..., 6561, 4).

    Friction acts on tension as a factor (Euler-Eytelwein), which its logarithm makes a summand.
    The last 6,561 samples are a settled period and what repeats of it: before that, tensions depend
    on the motion from which the rig was called to its calibration.  The settled period of a shorter
    motion is stretched to as many instants.
    """
    return logarithm(stretched(np.asarray(tension, dtype=np.float32)[..., first(motion) :, :]))


def first(motion: str) -> int:
    """First sample of a calibration motion's record that `course` reads."""
    recorded = calibration_motion(motion)
    return recorded.samples - INPUT if recorded.samples > INPUT else recorded.settled


def stretched(tension: Single) -> Single:
    """Samples (..., M, 4) joined by straight lines and read at 6,561 instants."""
    samples = tension.shape[-2]
    if samples == INPUT:
        return tension
    at = np.linspace(0.0, samples - 1, INPUT)
    left = np.minimum(at.astype(np.intp), samples - 2)
    share = (at - left).astype(np.float32)[:, None]
    return (1.0 - share) * tension[..., left, :] + share * tension[..., left + 1, :]


def logarithm(tension: Single) -> Single:
    """log(max(T, 0) + 0.5 N)."""
    return np.log(np.maximum(tension, np.float32(0.0)) + np.float32(SLACK))


def cnn_shapes(classes: int) -> dict[str, tuple[int, ...]]:
    """Shape of each array of weights of the network for a number of classes."""
    shapes: dict[str, tuple[int, ...]] = {'offset': (WIRE_COUNT,), 'scale': (WIRE_COUNT,)}
    for k, (width, wider) in enumerate(zip((WIRE_COUNT, *CHANNELS), CHANNELS, strict=False)):
        shapes |= {f'filter.{k}': (STRIDE * width, wider), f'bias.{k}': (wider,)}
    outputs, features = classes + OWN_OUTPUTS, CHANNELS[-1]
    shapes |= {'dense': (features, outputs), 'bias': (outputs,)}
    return shapes | {'centre': (features,), 'whitening': (features, features)}


def evaluated(weights: Mapping[str, Single], courses: Single) -> tuple[Array, Array]:
    """Outputs (R, O) and features (R, 64) of courses (R, 6561, 4).

    Batch normalisation is part of the convolutions here: once trained it is linear.
    """
    # Numbers that overflow end in an answer that is none, which loading refuses.
    with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
        signal = (courses - weights['offset']) / weights['scale']
        for k in range(len(CHANNELS)):
            windows = signal.reshape(len(signal), -1, STRIDE * signal.shape[2])
            signal = np.maximum(windows @ weights[f'filter.{k}'] + weights[f'bias.{k}'], 0.0)
        features = signal[:, 0]
        outputs = features @ weights['dense'] + weights['bias']
    return outputs.astype(np.float64), features.astype(np.float64)


class CnnClassifier:
    """A trained network of the shapes of `cnn_shapes`, calibrated on rigs held out from it."""

    def __init__(
        self,
        weights: Mapping[str, Single],
        calibration: HeldOutCalibration,
        classes_deg: tuple[int, ...],
        motion: str,
    ) -> None:
        self.weights = weights
        self.calibration = calibration
        self.classes_deg = classes_deg
        self.motion = motion  # calibration motion whose tensions it reads
        recorded = calibration_motion(motion)
        self._samples = recorded.samples
        period = recorded.samples - recorded.settled
        self._period = min(INPUT - 1, period if recorded.samples > INPUT else INPUT)

    def classify(self, tension: ArrayLike) -> ClassificationResult:
        """Class, size and interval of one calibration: tension (N, 4) in N at 1 kHz from its start.

        The wires are in the order x_pos, x_neg, y_pos, y_neg. UnseenTensionError where the tensions
        are unlike any of the training, or their size is none of the classes.
        """
        array = checked_tension(tension, (self._samples, WIRE_COUNT))
        judgement = self.judged(course(array, self.motion)[None])
        [reason] = self.reasons_to_refuse(judgement)
        if reason:
            raise UnseenTensionError(f'none of the classes: {reason}')
        return self.results(judgement)[0]

    def judged(self, courses: Single) -> Estimates:
        """What the network makes of courses (R, 6561, 4)."""
        outputs, features = evaluated(self.weights, courses)
        with np.errstate(over='ignore', invalid='ignore'):
            size, logarithm_of, none = outputs[:, len(self.classes_deg) :].T
            white = (features - self.weights['centre']) @ self.weights['whitening']
            return Estimates(
                MIDDLE + UNIT * size,
                LEAST_DEVIATION + UNIT * np.exp(logarithm_of),
                1.0 / (1.0 + np.exp(-none)),
                np.sqrt(np.sum(np.square(white), axis=1)),
                self._gap(courses),
            )

    def reasons_to_refuse(self, judgement: Estimates) -> list[str]:
        """Why each of R recordings is none of the classes; empty where it may be one."""
        smallest, greatest = self._range
        found = []
        for none, distance, gap, (low, high) in zip(
            judgement.none,
            judgement.distance,
            judgement.gap,
            self._intervals(judgement),
            strict=True,
        ):
            if gap > LARGEST_GAP:
                found.append(_OPEN.format(gap))
            elif none > self.calibration.doubt:
                found.append(_NONE)
            elif distance > self.calibration.ceiling:
                found.append(_FAR)
            elif low > greatest or high < smallest:
                found.append(
                    f'the backlash size is between {math.degrees(low):.1f} and '
                    f'{math.degrees(high):.1f} deg, outside the {math.degrees(smallest):.0f} to '
                    f'{math.degrees(greatest):.0f} deg of the classes'
                )
            else:
                found.append('')
        return found

    def results(self, judgement: Estimates) -> list[ClassificationResult]:
        """Result for each of R recordings, whether it is to be refused or not."""
        spread = self._half_width(judgement) / _NORMAL.inv_cdf(0.5 + 0.5 * LEVEL)
        return [
            of_size(size, deviation, self.classes_deg, interval)
            for size, deviation, interval in zip(
                judgement.size.tolist(), spread.tolist(), self._intervals(judgement), strict=True
            )
        ]

    def _gap(self, courses: Single) -> Array:
        """By how much wires' tensions differ from those a whole period later, N."""
        after = np.exp(courses[:, self._period :]).mean(axis=1)
        before = np.exp(courses[:, : INPUT - self._period]).mean(axis=1)
        return np.abs(after - before).max(axis=1).astype(np.float64)

    @property
    def _range(self) -> tuple[float, float]:
        ends = np.deg2rad([self.classes_deg[0], self.classes_deg[-1]])
        return float(ends[0] - HALF_CLASS), float(ends[1] + HALF_CLASS)

    def _intervals(self, judgement: Estimates) -> list[tuple[float, float]]:
        half = self._half_width(judgement)
        low, high = judgement.size - half, judgement.size + half
        return list(zip(low.tolist(), high.tolist(), strict=True))

    def _half_width(self, judgement: Estimates) -> Array:
        return judgement.deviation * self.calibration.inflation


def read_weights(path: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Description and arrays of a weights file; ClassifierError if missing, foreign or damaged."""
    path = Path(path)
    sidecar = path.with_suffix('.json')
    for each, largest in ((path, LARGEST_WEIGHTS), (sidecar, LARGEST_DESCRIPTION)):
        if not each.is_file():
            raise ClassifierError(
                f'{each} is missing: make classifier weights with `endoscope train --out FILE`'
            )
        if each.stat().st_size > largest:
            raise ClassifierError(f'{each} holds no classifier weights: larger than {largest} B')
    try:
        description = json.loads(sidecar.read_text(encoding='utf-8'))
        data = path.read_bytes()
    except (OSError, ValueError, RecursionError) as error:
        raise unusable(sidecar, error) from error
    if not isinstance(description, dict) or description.get('schema') != SCHEMA:
        raise ClassifierError(
            f'{sidecar} holds no classifier weights of schema {SCHEMA}: make new ones with '
            '`endoscope train --out FILE`'
        )
    if description.get(SEAL) != sealed(description, data)[SEAL]:
        raise ClassifierError(
            f'{path} holds no classifier weights: it and {sidecar.name} are not what was written '
            'together, one of them was damaged or exchanged'
        )
    try:
        state = safetensors.numpy.load(data)
    except (SafetensorError, ValueError, KeyError) as error:
        raise ClassifierError(
            f'{path} holds no classifier weights: it is no safetensors file of numbers ({error})'
        ) from error
    for name, array in state.items():
        if not np.all(np.isfinite(array)):
            raise unusable(path, ValueError(f'{name} holds values that are not finite'))
    return description, state


def sealed(description: dict[str, Any], data: bytes) -> dict[str, Any]:
    """The description with the SHA-256 of itself and of the weights, which ties them together."""
    rest = {key: value for key, value in description.items() if key != SEAL}
    digest = sha256(json.dumps(rest, sort_keys=True).encode() + data).hexdigest()
    return {**rest, SEAL: digest}


def fitting(
    state: dict[str, np.ndarray], shapes: Mapping[str, tuple[int, ...]], dtype: DTypeLike
) -> dict[str, np.ndarray]:
    """The arrays, whose names, shapes and type must be those that are due, or ValueError."""
    for name in shapes.keys() | state.keys():
        if name not in state or name not in shapes:
            raise ValueError(f'{name} is {"missing" if name in shapes else "unknown"}')
        found, due = state[name], shapes[name]
        if found.shape != due or found.dtype != dtype:
            raise ValueError(
                f'{name} is {found.dtype} {list(found.shape)} where {np.dtype(dtype)} {list(due)} '
                'is due'
            )
    return state


def unusable(path: str | Path, error: Exception) -> ClassifierError:
    """The error to raise where what was read does not fit together."""
    return ClassifierError(f'{path} holds no classifier weights: {error}')


@dataclass(frozen=True)
class _Description:
    """What the classifier needs of a description, which says more."""

    motion: str
    classes_deg: tuple[Annotated[int, within(0, 360)], ...]
    inflation: _Positive
    ceiling: _Positive
    doubt: _Positive

    def __post_init__(self) -> None:
        if len(self.classes_deg) < 2 or list(self.classes_deg) != sorted(set(self.classes_deg)):
            raise ValueError('classes_deg must be two or more, increasing')


def shipped_weights(motion: str) -> Path:
    """The weights that come with this package for a calibration motion."""
    name = f'cnn_{motion}.safetensors'
    return Path(str(files('endoscope_core.classifier') / 'weights' / name))


def load_classifier(weights: str | Path | None = None, motion: str = SINUSOID) -> CnnClassifier:
    """Classifier for a calibration motion, by default with the weights that come with this package.

    ClassifierError where a file is missing, is not what `endoscope train` writes, was damaged, is
    for another motion, or holds numbers that give no answer.
    """
    path = Path(weights) if weights else shipped_weights(motion)
    description, state = read_weights(path)
    try:
        needed = {
            f.name: description[f.name] for f in fields(_Description) if f.name in description
        }
        described = read(_Description, needed, path.with_suffix('.json').name)
        own = fitting(state, cnn_shapes(len(described.classes_deg)), np.float32)
    except ValueError as error:
        raise unusable(path, error) from error
    if described.motion != motion:
        raise ClassifierError(
            f'{path} was trained on the {described.motion} calibration, not the {motion} one'
        )
    calibration = HeldOutCalibration(described.inflation, described.ceiling, described.doubt)
    classifier = CnnClassifier(own, calibration, described.classes_deg, motion)
    # Slack wires' constant tension shows whether the numbers go together at all.
    slack = np.full((calibration_motion(motion).samples, WIRE_COUNT), 1.0)
    judgement = classifier.judged(course(slack, motion)[None])
    if not all(np.all(np.isfinite(x)) for x in vars(judgement).values()):
        raise ClassifierError(f'{path} holds no classifier weights: its answers are not finite')
    return classifier
