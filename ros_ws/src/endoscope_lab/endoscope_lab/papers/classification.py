"""Tables of classes, backlash sizes and reach, as a calibration identifies them from tensions."""

import time
from collections.abc import Sequence
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from endoscope_core.classifier.classification import UnseenTensionError
from endoscope_core.classifier.cnn_classifier import course, load_classifier
from endoscope_core.control import PhysicalParameters, bending_range
from endoscope_core.identification import load_class_parameters
from endoscope_core.identification.plant_fit import plants_of_calibration
from endoscope_core.physics import PlantDescription
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import BRIEF, CALIBRATION_MOTIONS, CALIBRATION_RATE, calibration_motion
from endoscope_lab.dataset import (
    CLASSES_DEG,
    CalibrationDataset,
    configuration_of_size,
    make_dataset,
    random_instrument,
    record_calibration,
)
from endoscope_lab.dataset.rig_variation import GREATEST_UNEVENNESS, TubeConfiguration, in_tube
from endoscope_lab.papers.real_recordings import (
    RealRecording,
    leave_one_out_errors,
    real_recordings,
)
from endoscope_lab.papers.row import Figure, PapersBench
from endoscope_lab.papers.tracking_trial import LIMITS, never_seen_tube

if TYPE_CHECKING:
    from endoscope_lab.papers.networks import CrossValidation

_CASES = ((54.0, '0.21 ± 0.02'), (85.5, '0.16 to 0.22'), (105.0, '0.18 to 0.25'))
_MOST_INSTRUMENTS = 300


def tension_by_shape_rows(settings: PapersBench) -> list[Figure]:
    """Simulate `tubes` shapes of each case: one rig of one size, with bends spread differently."""
    generator = np.random.default_rng([settings.seed, 1])
    spread = np.linspace(-GREATEST_UNEVENNESS, GREATEST_UNEVENNESS, settings.tubes).tolist()

    def shapes_of(size: float) -> list[TubeConfiguration]:
        """Shapes of the first drawn instrument that has this size in every shape."""
        for _ in range(_MOST_INSTRUMENTS):
            instrument = random_instrument(generator)
            shapes = []
            for unevenness in spread:
                shape = configuration_of_size(instrument, size, unevenness)
                if shape is None:
                    break
                shapes.append(shape)
            else:
                return shapes
        raise RuntimeError(f'no instrument of {_MOST_INSTRUMENTS} has {np.rad2deg(size):.0f} deg')

    tensions = []
    for size_deg, _ in _CASES:
        shapes = shapes_of(float(np.deg2rad(size_deg)))
        tensions.append(
            [
                record_calibration(shape.plant, settings.seed + k).tension
                for k, shape in enumerate(shapes)
            ]
        )
        settings.report(f'table 1: {size_deg:g} deg simulated')

    def rmse(first: np.ndarray, second: np.ndarray) -> float:
        return float(np.sqrt(np.mean((first - second) ** 2)))

    found = [
        Figure(
            f'{size_deg:g} deg, among like shapes',
            [rmse(a, b) for a, b in combinations(shapes, 2)],
            paper,
            note='The same instrument in tubes whose bends are spread differently, simulated.',
        )
        for (size_deg, paper), shapes in zip(_CASES, tensions, strict=True)
    ]
    for first, second in combinations(range(len(_CASES)), 2):
        found.append(
            Figure(
                f'{_CASES[first][0]:g} against {_CASES[second][0]:g} deg, unlike',
                [rmse(a, b) for a, b in product(tensions[first], tensions[second])],
            )
        )
    return found


_AS_MOUNTED = 'one instrument as mounted'
_ASKED = {
    _AS_MOUNTED: (True, False),
    'pretension set anew': (True, True),
    'another instrument each': (False, False),
}
"""Data sets by name: whether recordings are of one instrument, and whether its pretension is set
for each. The paper has one instrument, mounted once."""
_INSTRUMENTS = 3


def classifiers_rows(settings: PapersBench) -> list[Figure]:
    """Train the paper's network on folds of a data set; compare it with the shipped classifier."""
    from endoscope_lab.papers.networks import cross_validate, use_one_thread

    use_one_thread()
    found = []
    datasets: list[CalibrationDataset] = []
    for asked, (one, anew) in _ASKED.items():
        datasets.clear()
        for seed in range(settings.seed, settings.seed + (_INSTRUMENTS if one else 1)):
            settings.report(f'simulating 210 calibrations by the sinusoid: {asked}')
            datasets.append(make_dataset(seed, one_instrument=one, reset_pretension=anew))
        settings.report('cross-validating the 1D-CNN')
        validations = [cross_validate(each, settings.seed) for each in datasets]
        paper = '98.47' if asked == _AS_MOUNTED else '-'
        found.append(_accuracy_row(f'1D-CNN, {asked}: accuracy [%]', paper, validations))
    found.append(_ours('sinusoid of 9 s', datasets[0], settings))
    settings.report('simulating 210 calibrations by the brief motion')
    brief = make_dataset(settings.seed, motion=BRIEF)
    found.append(_ours('brief motion of 3 s', brief, settings))
    return found


def _ours(name: str, dataset: CalibrationDataset, settings: PapersBench) -> Figure:
    """The shipped classifier, which was trained on none of the recordings."""
    settings.report(f'ours, {name}')
    classifier = load_classifier(motion=dataset.motion)
    results = [
        classifier.results(classifier.judged(course(tension[None], dataset.motion)))[0]
        for tension in dataset.tension
    ]
    right = [r.class_deg == c for r, c in zip(results, dataset.class_deg, strict=True)]
    groups = [slice(k, None, settings.tubes) for k in range(settings.tubes)]
    return Figure(
        f'ours, {name}, instruments never seen: accuracy [%]',
        [100.0 * float(np.mean(right[g])) for g in groups],
        '98.47',
        at_least=99.0,
    )


def _accuracy_row(name: str, theirs: str, validations: 'list[CrossValidation]') -> Figure:
    shares = [100.0 * share for each in validations for share in each.accuracy]
    confusion = np.sum([each.confusion for each in validations], axis=0)
    confused = '; '.join(
        f'{CLASSES_DEG[i]} taken for {CLASSES_DEG[j]} deg: {count}'
        for i, line in enumerate(confusion.tolist())
        for j, count in enumerate(line)
        if i != j and count
    )
    return Figure(name, shares, theirs, note=f'{name}: {confused or "none confused"}')


_SHAPES = (
    (94.0, ('15.76', '12.40', '7.61', '7.20', '2.52', '1.79', '4.06')),
    (102.0, ('19.76', '17.14', '11.55', '12.60', '7.24', '6.00', '4.86')),
)


def nearest_class_rows(settings: PapersBench) -> list[Figure]:
    """Compare the calibration of tubes of 94 and 102 deg with the mean plant of each class."""
    classes = {}
    for class_deg, plant in load_class_parameters(model='physical').items():
        if isinstance(plant, PhysicalParameters):
            tube = PlantDescription({'bend_x': plant.joint, 'bend_y': plant.joint})
            classes[class_deg] = record_calibration(tube, settings.seed).actual_angle
    found = []
    for size_deg, papers in _SHAPES:
        angles = []
        for number in range(settings.tubes):
            tube_seen = never_seen_tube(settings.seed, number, size_deg)
            angles.append(record_calibration(tube_seen.plant, tube_seen.noise).actual_angle)
        for (class_deg, reference), paper in zip(sorted(classes.items()), papers, strict=True):
            values = [
                float(np.rad2deg(np.sqrt(np.mean((angle - reference) ** 2)))) for angle in angles
            ]
            found.append(Figure(f'backlash {size_deg:g} deg, class {class_deg} deg', values, paper))
        settings.report(f'table 4: {size_deg:g} deg simulated')
    return found


_TUBES = 20
_LARGEST = 5.0
_BENDS = (0.0, float(np.deg2rad(270.0)))


def reach_rows(settings: PapersBench) -> list[Figure]:
    """Random instruments in random tubes of the family, both joints."""
    errors = []
    for number in range(_TUBES):
        generator = np.random.default_rng([settings.seed, number])
        instrument = random_instrument(generator)
        unevenness = generator.uniform(-GREATEST_UNEVENNESS, GREATEST_UNEVENNESS)
        plant = in_tube(instrument, generator.uniform(*_BENDS), unevenness)
        recording = record_calibration(plant, int(generator.integers(2**31)))
        found = plants_of_calibration(
            recording.desired_angle, recording.tension, shipped_rig().joints.gear
        )
        for joint, fit in zip(plant.joints.values(), found, strict=True):
            true, guess = (bending_range(each, LIMITS) for each in (joint, fit.joint))
            errors.append(100.0 * abs((guess.high - guess.low) / (true.high - true.low) - 1.0))
        settings.report(f'reach: tube {number + 1} of {_TUBES}')
    return [
        Figure('error', errors, digits=1),
        Figure('largest', [max(errors)], at_most=_LARGEST, digits=1),
    ]


def calibration_time_rows(settings: PapersBench) -> list[Figure]:
    """Rest, motion and return as the calibration node commands them, and computing time."""
    # Motion in the rig's time; computing class, size and plant is timed on this machine, once for
    # each tube.
    rest, gear = 0.5, shipped_rig().joints.gear
    found = []
    for name in CALIBRATION_MOTIONS:
        motion = calibration_motion(name)
        moving = rest + motion.signal.duration
        classifier = load_classifier(motion=name)
        judging, fitting = [], []
        for number in range(settings.tubes):
            tube = never_seen_tube(settings.seed, number)
            recording = record_calibration(tube.plant, tube.noise, motion)
            begin = time.perf_counter()
            try:
                classifier.classify(recording.tension)
            except UnseenTensionError as error:
                settings.report(f'{name}, tube {number + 1}: {error}')
            judging.append(time.perf_counter() - begin)
            begin = time.perf_counter()
            plants_of_calibration(recording.desired_angle, recording.tension, gear)
            fitting.append(time.perf_counter() - begin)
        brief = name != CALIBRATION_MOTIONS[0]
        found += [
            Figure(
                f'{name}: class and size',
                (moving + np.array(judging)).tolist(),
                '' if brief else '< 11',
                at_most=5.0 if brief else 11.0,
            ),
            Figure(
                f'{name}: class, size and plant',
                (moving + np.array(judging) + np.array(fitting)).tolist(),
                at_most=5.0 if brief else None,
            ),
            Figure(f'{name}: of that, computing the plant', fitting),
        ]
    return found


def real_sizes_rows(settings: PapersBench) -> list[Figure]:
    """A line through the other tubes' sizes, and the shipped network; empty without recordings."""
    recordings = real_recordings()
    if not recordings:
        settings.report('no recordings at hand; set ENDOSCOPE_SHARED')
        return []
    sizes = [float(np.rad2deg(recording.backlash_size)) for recording in recordings]
    errors = leave_one_out_errors([recording.tension_width for recording in recordings], sizes)
    note = 'errors of each: ' + ', '.join(f'{e:+.1f}' for e in errors)
    return [
        Figure(
            'straight line through the other tubes: rms error [deg]',
            [float(np.sqrt(np.mean(errors**2)))],
            '3.4 (two features picked by hand)',
            at_most=3.4,
            note=note,
        ),
        _of_the_network(recordings),
    ]


def _of_the_network(recordings: Sequence[RealRecording]) -> Figure:
    """The shipped network, trained on motions of 90 deg, where these tubes moved by 60 deg."""
    classifier, motion = load_classifier(), calibration_motion()
    phase = np.arange(motion.samples) / CALIBRATION_RATE
    errors, notes = [], []
    for recording in recordings:
        wires = [np.interp(phase, recording.phase, wire) for wire in recording.tension.T]
        # Only one joint was moved; its two wires are used for both joints.
        judgement = classifier.judged(course(np.stack(2 * wires, axis=1)[None], motion.name))
        true, [size] = np.rad2deg(recording.backlash_size), np.rad2deg(judgement.size)
        errors.append(size - true)
        [reason] = classifier.reasons_to_refuse(judgement)
        notes.append(
            f'tube of {recording.bend} deg: {true:.1f} deg, the network {size:.1f} deg'
            f'{", refused: " + reason if reason else ""}'
        )
    return Figure(
        'the shipped 1D-CNN, trained on another motion: rms error [deg]',
        [float(np.sqrt(np.mean(np.square(errors))))],
        note='\n  '.join(notes),
    )
