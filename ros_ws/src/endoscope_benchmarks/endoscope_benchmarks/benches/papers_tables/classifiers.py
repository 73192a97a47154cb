"""Table 3 of the first paper: classes and sizes from tensions, on tubes held out."""

import math
from typing import TYPE_CHECKING

import numpy as np

from endoscope_benchmarks.benches.inference_time import inference_time
from endoscope_benchmarks.benches.papers_tables.row import PapersBench, Row

if TYPE_CHECKING:
    from endoscope_benchmarks.networks.grouped_folds import CrossValidation
    from endoscope_core.classifier.classification import Classifier
    from endoscope_core.dataset import CalibrationDataset

TITLE = 'First paper, table 3: class and backlash size from wire tensions'

_THEIRS = {
    'mlp': ('MLP', '80'),
    'recurrence_plot_cnn': ('RP + CNN', '92'),
    'cnn': ('1D-CNN', '98.47'),
}
_AS_MOUNTED = 'one instrument as mounted'
_ASKED = {
    _AS_MOUNTED: (True, False),
    'pretension set anew': (True, True),
    'another instrument each': (False, False),
}
"""What a network is asked, and whether recordings are of one instrument and its pretension is set
for each: the paper has one instrument, mounted once."""
_INSTRUMENTS = 3
_UNSEEN_OF_EACH = 40
_UNUSUAL_OF_EACH = 6
_INFERENCE_LIMIT_S = 0.010


def rows(settings: PapersBench) -> list[Row]:
    """Train the paper's networks on folds of a data set; judge it by the shipped classifier."""
    from endoscope_benchmarks.networks.papers_recipe import NETWORKS, cross_validate, use_one_thread
    from endoscope_core.dataset import make_dataset
    from endoscope_core.signals import BRIEF

    use_one_thread()
    found = []
    datasets: list[CalibrationDataset] = []
    for asked, (one, anew) in _ASKED.items():
        datasets.clear()
        for seed in range(settings.seed, settings.seed + (_INSTRUMENTS if one else 1)):
            settings.report(f'simulating 210 calibrations by the sinusoid: {asked}')
            datasets.append(make_dataset(seed, one_instrument=one, reset_pretension=anew))
        for kind in NETWORKS:
            name, theirs = _THEIRS[kind]
            settings.report(f'cross-validating {name}')
            # Plots of 60 by 60 take as long as all the rest.
            used = datasets[:1] if kind == 'recurrence_plot_cnn' else datasets
            validations = [cross_validate(each, settings.seed, kind=kind) for each in used]
            paper = theirs if asked == _AS_MOUNTED else '-'
            found.append(_accuracy_row(f'{name}, {asked}: accuracy [%]', paper, validations))
    found += _ours('sinusoid of 9 s', datasets[0], settings)
    settings.report('simulating 210 calibrations by the brief motion')
    brief = make_dataset(settings.seed, motion=BRIEF)
    found += _ours('brief motion of 3 s', brief, settings)
    return found


def _ours(name: str, dataset: 'CalibrationDataset', settings: PapersBench) -> list[Row]:
    """The classifier that comes with the project, which was trained on none of the recordings."""
    from endoscope_core.classifier.cnn_classifier import course
    from endoscope_core.classifier.weights_file import load_classifier

    settings.report(f'ours, {name}')
    classifier = load_classifier(motion=dataset.motion)
    results = [
        classifier.results(classifier.judged(course(tension[None], dataset.motion)))[0]
        for tension in dataset.tension
    ]
    true = dataset.backlash_size
    right = [r.class_deg == c for r, c in zip(results, dataset.class_deg, strict=True)]
    error = np.rad2deg([r.expected_size for r in results]) - np.rad2deg(true)
    holds = [r.holds(size) for r, size in zip(results, true.tolist(), strict=True)]
    groups = [slice(k, None, settings.tubes) for k in range(settings.tubes)]
    found = [
        Row(
            f'ours, {name}, instruments never seen: accuracy [%]',
            [100.0 * float(np.mean(right[g])) for g in groups],
            '98.47',
            at_least=99.0,
        ),
        Row(
            'size: rms error [deg]',
            [float(np.sqrt(np.mean(error[g] ** 2))) for g in groups],
            at_most=2.0,
        ),
        Row(
            'size: in their 90 % interval [%]',
            [100.0 * float(np.mean(holds[g])) for g in groups],
            at_least=85.0,
            at_most=95.0,
            digits=1,
        ),
    ]
    inference = Row(
        'inference, share of 10 ms',
        [inference_time(classifier) / _INFERENCE_LIMIT_S],
        at_most=1.0,
    )
    return [*found, *_outside(classifier, settings), inference]


def _outside(classifier: 'Classifier', settings: PapersBench) -> list[Row]:
    """Tubes of any size and unusual tensions, in as many groups as the bench has tubes."""
    from endoscope_benchmarks.trials.classifier_trial import judge_unseen_tubes, refused_of_kind
    from endoscope_benchmarks.trials.unusual_recordings import UNUSUAL

    groups = settings.tubes
    trials = judge_unseen_tubes(classifier, settings.seed, _UNSEEN_OF_EACH * groups)
    rmse, coverage, refused = [], [], []
    for k in range(groups):
        group = trials[k::groups]
        judged = [(t.size, t.result) for t in group if t.result is not None]
        errors = [result.expected_size - size for size, result in judged]
        inside = [result.holds(size) for size, result in judged]
        rmse.append(math.degrees(float(np.sqrt(np.mean(np.square(errors))))))
        coverage.append(100.0 * float(np.mean(inside)))
        refused.append(100.0 * (1.0 - len(judged) / len(group)))
    found = [
        Row('size, tubes of any size: rms error [deg]', rmse, at_most=2.0),
        Row(
            'size, tubes of any size: in their 90 % interval [%]',
            coverage,
            at_least=85.0,
            at_most=95.0,
            digits=1,
        ),
        Row('refused, tubes of any size [%]', refused, digits=1),
    ]
    for kind in UNUSUAL:
        shares = np.array_split(
            refused_of_kind(classifier, kind, settings.seed, _UNUSUAL_OF_EACH * groups), groups
        )
        found.append(
            Row(f'refused, {kind} [%]', [100.0 * float(np.mean(s)) for s in shares], digits=1)
        )
    return found


def _accuracy_row(name: str, theirs: str, validations: 'list[CrossValidation]') -> Row:
    from endoscope_core.dataset import CLASSES_DEG

    shares = [100.0 * share for each in validations for share in each.accuracy]
    confusion = np.sum([each.confusion for each in validations], axis=0)
    confused = '; '.join(
        f'{CLASSES_DEG[i]} taken for {CLASSES_DEG[j]} deg: {count}'
        for i, line in enumerate(confusion.tolist())
        for j, count in enumerate(line)
        if i != j and count
    )
    return Row(name, shares, theirs, note=f'{name}: {confused or "none confused"}')
