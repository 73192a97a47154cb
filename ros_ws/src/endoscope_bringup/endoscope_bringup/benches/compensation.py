"""`endoscope bench compensation`: tracking error left on tubes that nothing was fitted on."""

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from endoscope_bringup.benches.inference_time import inference_time
from endoscope_bringup.seed_argument import seed

if TYPE_CHECKING:
    from endoscope_core.trials.unseen_tube_trial import UnseenTubeTrial

FEEDFORWARD_LIMIT = 0.30
FEEDBACK_LIMIT = 0.15


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `compensation`."""
    parser = subparsers.add_parser(
        'compensation',
        help='tracking error left on unseen tubes',
        description='Calibrates, classifies and tracks on random rigs in random tubes, and prints '
        'the error as a share of the uncompensated one. Exits 1 if a limit is missed on '
        '60 sin(t).',
    )
    parser.add_argument('--tubes', type=int, default=10, metavar='N', help='number of tubes (10)')
    parser.add_argument('--seed', type=seed, default=1, help='chooses the tubes (1)')


def run(args: argparse.Namespace) -> int:
    """Run and print; return 0 if the limits are kept on every tube, else 1."""
    from endoscope_core.classifier.shipped import load_classifier
    from endoscope_core.classifier.training import use_one_thread
    from endoscope_core.identification import load_class_parameters
    from endoscope_core.signals import non_periodic_signal, periodic_signal
    from endoscope_core.trials.unseen_tube_trial import run_unseen_tube_trial

    use_one_thread()
    signals = [periodic_signal(), non_periodic_signal()]
    classifier, sets = load_classifier(), load_class_parameters()
    trials = []
    print('tube  exponent  size  class  signal        none     feed-forward  with feedback')
    for number in range(args.tubes):
        trial = run_unseen_tube_trial(args.seed, number, signals, classifier, sets)
        trials.append(trial)
        for line in _lines(number, trial):
            print(line, flush=True)
    for signal in signals:
        print(_summary(signal.name, trials))
    near = sum(trial.nearest_class for trial in trials)
    print(f'class within 5 deg of the size: {near} of {len(trials)}')
    print(f'inference: {inference_time(classifier) * 1e3:.2f} ms on one thread')
    worst = [
        max(getattr(trial, kind)['periodic'] for trial in trials)
        for kind in ('feedforward', 'feedback')
    ]
    return 0 if worst[0] <= FEEDFORWARD_LIMIT and worst[1] <= FEEDBACK_LIMIT else 1


def _lines(number: int, trial: 'UnseenTubeTrial') -> list[str]:
    import math

    return [
        f'{number:4d}  {trial.exponent:8.2f}  {math.degrees(trial.size):4.0f}  '
        f'{trial.class_deg or "none":>5}  {name:12s}  {math.degrees(alone):4.1f} deg  '
        f'{100.0 * trial.feedforward[name]:11.1f}%  {100.0 * trial.feedback[name]:12.1f}%'
        for name, alone in trial.uncompensated.items()
    ]


def _summary(signal: str, trials: 'Sequence[UnseenTubeTrial]') -> str:
    import numpy as np

    parts = []
    for label, kind in (('feed-forward', 'feedforward'), ('with feedback', 'feedback')):
        shares = 100.0 * np.array([getattr(trial, kind)[signal] for trial in trials])
        parts.append(
            f'{label} {np.mean(shares):.1f} +- {np.std(shares):.1f} % '
            f'(worst {np.max(shares):.1f} %)'
        )
    return f'{signal}: {", ".join(parts)} of the uncompensated RMSE'
