"""`endoscope bench cells`: how a calibration fares with load cells as they are."""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from endoscope_core.classifier.classification import ClassificationResult, nearest_class
from endoscope_core.classifier.cnn_classifier import CnnClassifier, first, logarithm, stretched
from endoscope_core.classifier.held_out_calibration import (
    STRANGE,
    drifting,
    exchanged_across_joints,
    read,
)
from endoscope_core.classifier.weights_file import load_classifier
from endoscope_core.dataset import CLASSES_DEG
from endoscope_core.dataset.rig_variation import calibration_command
from endoscope_core.dataset.training_rigs import training_rigs
from endoscope_core.physics import simulate
from endoscope_core.signals import calibration_motion
from endoscope_lab.papers.tracking_trial import configuration_of

_PERIODS_MS = (1, 5, 10)
_ZEROS_N = (0.02, 0.05, 0.1, 0.2, 0.5)
_GAINS = (0.01, 0.03, 0.1)
_OUTSIDE_DEG = (30.0, 120.0)


def run(args: argparse.Namespace) -> int:
    classifier = load_classifier(args.weights, args.motion)
    tubes = tubes_of_sizes(args.seed, CLASSES_DEG, args.tubes, args.motion)
    print(f'{args.motion}, seed {args.seed}, {len(tubes.size)} tubes')
    print('cells                                 right   wrong  refused  size: rms    90 % holds')
    cases: dict[str, dict] = {
        f'good, read at {1000 // period} Hz': {'period': period} for period in _PERIODS_MS
    }
    cases |= {f'zero errors of {zero} N (sd)': {'zero': zero} for zero in _ZEROS_N}
    cases |= {f'gain errors of {100 * gain:.0f} % (sd)': {'gain': gain} for gain in _GAINS}
    cases |= {
        f'0.1 N and 3 %, read at {1000 // period} Hz': {'period': period, 'zero': 0.1, 'gain': 0.03}
        for period in _PERIODS_MS
    }
    cases |= {fault: {'fault': fault} for fault in FAULTS}
    for name, case in cases.items():
        _judge(name, classifier, tubes, args.seed, **case)
    for size in _OUTSIDE_DEG:
        outside = tubes_outside(args.seed, size, args.tubes, args.motion)
        _judge(f'good, tubes of {size:.0f} deg', classifier, outside, args.seed)
    return 0


Single = NDArray[np.float32]
Generator = np.random.Generator
Spoil = Callable[[Single, Generator], Single]

SIZE_SPREAD_DEG = 1.0
DRIFTS_N = (0.2, 0.5, 1.5)
_NEVER_SEEN = 848_484
_PART = 64

FAULTS: dict[str, Spoil] = {
    **STRANGE,
    **{
        f'drifting by {drift} N in a calibration': partial(drifting, drift=drift)
        for drift in DRIFTS_N
    },
    'exchanged across joints': exchanged_across_joints,
}
"""What is done to one recording (N, 4), to be refused or harmless."""


@dataclass(frozen=True)
class Tubes:
    """R tubes of known size and their tensions without noise."""

    size: NDArray[np.float64]  # (R,), rad
    tension: Single  # (R, N, 4) in N at 1 kHz, what the classifier reads of the record


def tubes_of_sizes(seed: int, sizes_deg: tuple[float, ...], each: int, motion: str) -> Tubes:
    """Random instruments, which trained nothing, in tubes that give them a size to 1 deg."""
    recorded = calibration_motion(motion)
    sizes, tensions = [], []
    for size_deg in sizes_deg:
        for number in range(each):
            generator = np.random.default_rng([_NEVER_SEEN, seed, round(10 * size_deg), number])
            size = float(np.deg2rad(size_deg + SIZE_SPREAD_DEG * generator.uniform(-1.0, 1.0)))
            found = configuration_of(generator, size)
            trajectory = simulate(found.plant, calibration_command(found.plant, recorded))
            wires = trajectory.tension.reshape(len(trajectory.time), -1)
            sizes.append(found.backlash_size)
            tensions.append(wires[first(motion) :].astype(np.float32))
    return Tubes(np.array(sizes), np.stack(tensions))


def tubes_outside(seed: int, size_deg: float, count: int, motion: str) -> Tubes:
    """Rigs of wide spreads with a size to 2 deg that those of the project hardly have."""
    ends = (float(np.deg2rad(size_deg - 2.0)), float(np.deg2rad(size_deg + 2.0)))
    rigs = training_rigs(_NEVER_SEEN + seed, count, motion, first(motion), sizes=ends)
    return Tubes(rigs.size, rigs.tension)


def _judge(
    name: str,
    classifier: CnnClassifier,
    tubes: Tubes,
    seed: int,
    *,
    period: int = 1,
    zero: float = 0.0,
    gain: float = 0.0,
    fault: str = '',
) -> None:
    """Judge tubes as cells `read` them, with its period, zero and gain, and print."""
    generator = np.random.default_rng([_NEVER_SEEN, seed, period])
    results: list[ClassificationResult] = []
    refused: list[bool] = []
    for rows in np.array_split(np.arange(len(tubes.size)), max(1, len(tubes.size) // _PART)):
        tension = tubes.tension[rows]
        if fault:
            tension = np.stack([FAULTS[fault](each, generator) for each in tension])
        courses = logarithm(stretched(read(tension, generator, period, zero, gain)))
        judgement = classifier.judged(courses)
        results += classifier.results(judgement)
        refused += [bool(reason) for reason in classifier.reasons_to_refuse(judgement)]
    nearest = np.array([nearest_class(size, CLASSES_DEG) for size in tubes.size.tolist()])
    known = ~np.array(refused)
    right = np.array([r.class_deg for r in results]) == nearest
    errors = np.array([r.expected_size for r in results]) - tubes.size
    holds = np.array([r.holds(x) for r, x in zip(results, tubes.size.tolist(), strict=True)])
    # Right and wrong by the class nearest to the true size; the size of what was not refused.
    shares = (100.0 * float(np.mean(each)) for each in (right & known, ~right & known, ~known))
    line = '{:36s} {:5.1f} % {:5.1f} % {:6.1f} %  '.format(name, *shares)
    if known.any():
        rmse = np.rad2deg(np.sqrt(np.mean(errors[known] ** 2)))
        line += f'{rmse:6.2f} deg  {100.0 * np.mean(holds[known]):6.1f} %'
    else:
        line += '     -           -'
    print(line, flush=True)
