"""What every compensator leaves of the error, on random rigs in random tubes."""

import numpy as np

from endoscope_benchmarks.benches.papers_tables.row import PapersBench, Row

TITLE = (
    'RMSE left on tubes never seen in fitting, % of the uncompensated; signals scaled to 80 % of '
    'the reach of the tube where that is less'
)
_LARGEST_PEAK_DEG = 10.0
_FEEDFORWARD = (
    ('bouc_wen', 'class', '24 to 27', 20.0),
    ('bouc_wen', 'size', '', 12.0),
    ('asymmetric_bouc_wen', 'size', '', None),
    ('dahl', 'size', '', None),
    ('play', 'size', '', None),
    ('prandtl_ishlinskii', 'size', '', None),
    ('physical', 'class', '', 20.0),
    ('physical', 'size', '', 12.0),
    ('physical', 'plant', '', 12.0),
)
_FEEDBACK = (
    ('bouc_wen', 'class', 'adaptive', None),
    ('bouc_wen', 'class', 'recursive_least_squares', None),
    ('physical', 'plant', 'adaptive', None),
    ('adaptive_physical', 'plant', '', 6.0),
)


def rows(settings: PapersBench) -> list[Row]:
    """Both signals, both joints at once, feed-forward alone and with the 40 Hz tracker."""
    from endoscope_benchmarks.trials.never_seen_tube import calibrate, never_seen_tube, within_reach
    from endoscope_benchmarks.trials.tracking_trial import run_tracking_trial
    from endoscope_core.classifier.weights_file import load_classifier
    from endoscope_core.control import (
        AdaptiveBacklashController,
        FeedforwardLaw,
        RecursiveHysteresisController,
    )
    from endoscope_core.errors import EndoscopeError
    from endoscope_core.identification.law_choice import LawChoice
    from endoscope_core.signals import non_periodic_signal, periodic_signal

    classifier, choice = load_classifier(), LawChoice(2)
    left: dict[str, list[float]] = {}
    peaks: dict[str, list[float]] = {}
    pulled: dict[str, list[float]] = {}
    papers: dict[str, tuple[str, float | None]] = {}
    schemes: list[tuple[str, str, str | None, str, float | None]] = [
        (mode, by, None, paper, aim) for mode, by, paper, aim in _FEEDFORWARD
    ]
    schemes += [(mode, by, law, '', aim) for mode, by, law, aim in _FEEDBACK]
    refused = 0
    for number in range(settings.tubes):
        tube = never_seen_tube(settings.seed, number)
        findings = calibrate(tube, classifier)
        for whole in (periodic_signal(), non_periodic_signal()):
            signal = within_reach(whole, tube.plant)
            none = run_tracking_trial(tube.plant, signal, FeedforwardLaw(), False, tube.noise).rmse
            for mode, by, feedback, paper, aim in schemes:
                try:
                    law = choice.law(mode, by, findings)
                except EndoscopeError as error:
                    settings.report(f'{mode} by {by}: {error}')
                    refused += 1
                    continue
                controller = (
                    RecursiveHysteresisController(2)
                    if feedback == 'recursive_least_squares'
                    else AdaptiveBacklashController(2)
                )
                trial = run_tracking_trial(
                    tube.plant, signal, law, feedback is not None, tube.noise, controller
                )
                helped = '' if feedback is None else f' + {feedback or "tracker"}'
                name = f'{signal.name}, {mode} by {by}{helped}'
                papers[name] = paper, aim
                left.setdefault(name, []).append(100.0 * trial.rmse / none)
                second_cycle = signal.steady[0] + 2.0 * np.pi, signal.steady[1]
                peaks.setdefault(name, []).append(float(np.rad2deg(trial.peak(*second_cycle))))
                pulled.setdefault(name, []).append(float(np.max(trial.tension)))
        settings.report(f'compensators: tube {number + 1} of {settings.tubes}')
    note = f'{refused} refused: the calibration did not say enough.' if refused else ''
    found = []
    for name, values in sorted(left.items()):
        paper, aim = papers[name]
        limit = None if aim is None else _LARGEST_PEAK_DEG
        found += [
            Row(name, values, paper, at_most=aim, digits=1, note=note),
            Row(f'{name}: largest peak, deg', [max(peaks[name])], at_most=limit, digits=1),
            Row(f'{name}: largest tension, N', [max(pulled[name])], digits=1),
        ]
    return found
