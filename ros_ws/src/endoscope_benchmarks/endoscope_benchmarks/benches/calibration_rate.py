"""`endoscope bench calibration_rate`: what a calibration loses where load cells are read slowly."""

import argparse

from endoscope_bringup.subcommands import COUNT, seed

RATES = (100, 125, 200, 250, 450, 500, 990, 1000)
GAPS_MS = (20, 30, 40, 50, 60)
DELAYS_MS = (2, 5, 10, 20)
OTHERWISE_AT = 200


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `calibration_rate`."""
    parser = subparsers.add_parser(
        'calibration_rate',
        help='what a calibration loses where load cells are read slowly',
        description='Calibrates tubes that nothing was fitted on with load cells read at 100 Hz '
        'to 1 kHz, each reading up to a fifth of the interval early or late; then at 200 Hz with '
        'one gap where the tension bends most, and with readings older than their stamps. Exits 1 '
        'if at some rate a class is wrong or more than one known tube of a hundred is refused.',
    )
    parser.add_argument('--seed', type=seed, default=1, help='chooses tubes, rigs and noise (1)')
    parser.add_argument('--tubes', type=COUNT, default=10, metavar='N', help='tubes a class (10)')


def run(args: argparse.Namespace) -> int:
    """Measure and print; return 0 if every rate calibrates, else 1."""
    from endoscope_benchmarks.trials.reading_rates import (
        judged_at_rate,
        refused_at_rate,
        tubes_of_all_classes,
    )
    from endoscope_benchmarks.trials.unseen_tubes import UNUSUAL
    from endoscope_core.classifier.weights_file import load_classifier
    from endoscope_core.signals import CALIBRATION_MOTIONS, calibration_motion

    if args.tubes < 1:
        print('endoscope bench calibration_rate: --tubes: give at least 1')
        return 2
    kept = True
    for name in CALIBRATION_MOTIONS:
        classifier = load_classifier(motion=name)
        tubes = tubes_of_all_classes(args.seed, args.tubes, calibration_motion(name))
        print(f'\n{name}, {len(tubes)} tubes, {len(UNUSUAL) * args.tubes} unusual recordings')
        print(_HEAD.format('read at', 'unusual refused'))
        for rate in RATES:
            trials = [
                judged_at_rate(classifier, tube, rate, args.seed + k)
                for k, tube in enumerate(tubes)
            ]
            refused = [
                refused_at_rate(classifier, kind, rate, args.seed + k)
                for kind in UNUSUAL
                for k in range(args.tubes)
            ]
            print(f'{rate:5d} Hz {_row(trials)}  {100.0 * sum(refused) / len(refused):5.1f} %')
            kept = kept and _kept(trials)
        for what, amounts in (('gap', GAPS_MS), ('delay', DELAYS_MS)):
            print(_HEAD.format(what, ''))
            for amount in amounts:
                trials = [
                    judged_at_rate(
                        classifier, tube, OTHERWISE_AT, args.seed + k, **{what: 1e-3 * amount}
                    )
                    for k, tube in enumerate(tubes)
                ]
                print(f'{amount:5d} ms {_row(trials)}')
    return 0 if kept else 1


_HEAD = '{:8s} class right  refused  probability: mean, least  size: rms   90 % interval, holds  {}'


def _row(trials: list) -> str:
    import numpy as np

    judged = [t for t in trials if t.result is not None]
    right = sum(t.result.class_deg == t.class_deg for t in judged)
    probability = [t.result.probability for t in judged]
    error = np.rad2deg([t.result.size - t.size for t in judged])
    half = np.rad2deg([np.ptp(t.result.interval) / 2.0 for t in judged])
    holds = sum(t.result.holds(t.size) for t in judged)
    return (
        f'{right:5d} of {len(judged):3d}  {len(trials) - len(judged):6d}  '
        f'{np.mean(probability):16.3f}, {np.min(probability):.3f}  '
        f'{np.sqrt(np.mean(error**2)):9.2f} deg  {np.mean(half):6.2f} deg, '
        f'{100.0 * holds / len(judged):5.1f} %'
    )


def _kept(trials: list) -> bool:
    judged = [t for t in trials if t.result is not None]
    right = all(t.result.class_deg == t.class_deg for t in judged)
    return right and len(trials) - len(judged) <= 0.01 * len(trials)
