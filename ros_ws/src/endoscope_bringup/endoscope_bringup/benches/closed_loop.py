"""`endoscope bench closed_loop`: tracking with the inverse of an explained plant."""

import argparse
from importlib.resources import files
from pathlib import Path

from endoscope_bringup.seed_argument import seed

EFFECTS = (
    'friction_asymmetry',
    'wire_stiffening',
    'wire_creep',
    'viscous_friction',
    'presliding_shape',
    'joint_backlash',
    'contact',
    'gravity',
)
"""Effects that disturb tracking and last: none that starts at some time or sits in a sensor."""


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `closed_loop`."""
    parser = subparsers.add_parser(
        'closed_loop',
        help='tracking with the inverse of an explained plant',
        description='Conceals an effect in a slave of independent physics, explains its '
        'commissioning recording, and tracks 60 sin(t) with the inverse of the plant as described, '
        'refitted and explained, and with the Bouc-Wen model of its class.',
    )
    parser.add_argument(
        '--effect', action='append', metavar='ID', help='conceal this one only (may be repeated)'
    )
    parser.add_argument('--seed', type=seed, default=1, help='chooses the slaves (1)')


def run(args: argparse.Namespace) -> int:
    """Run and print; return 0 if the explained inverse is the best on average, else 1."""
    import numpy as np

    from endoscope_core.classifier.shipped import load_classifier
    from endoscope_core.classifier.training import use_one_thread
    from endoscope_core.identification import load_class_parameters
    from endoscope_core.signals import periodic_signal
    from endoscope_explain.benchmark.closed_loop import EXPLAINED, WAYS, run_closed_loop

    use_one_thread()
    # The first paper's network: it names a class for any tension.
    network = files('endoscope_core.classifier') / 'weights' / 'tension_cnn.pt'
    classifier, sets = load_classifier(Path(str(network))), load_class_parameters()
    print('rms error of the tip on 60 sin(t), deg')
    print(f'{"concealed":20s}' + ''.join(f'{way:>36s}' for way in WAYS) + '  named')
    trials = []
    for effect in args.effect or EFFECTS:
        trial = run_closed_loop(args.seed, effect, periodic_signal(), classifier, sets)
        trials.append(trial)
        line = ''.join(f'{np.rad2deg(trial.errors[way]):36.2f}' for way in WAYS)
        print(f'{effect:20s}{line}  {", ".join(trial.named) or "-"}', flush=True)
    means = {way: float(np.mean([t.errors[way] for t in trials])) for way in WAYS}
    print(f'{"mean":20s}' + ''.join(f'{np.rad2deg(means[way]):36.2f}' for way in WAYS))
    return 0 if min(means, key=lambda way: means[way]) == EXPLAINED else 1
