"""What every compensator takes away of the error, on random rigs in random tubes."""

from endoscope_bringup.benches.papers_tables.row import PapersBench, Row

TITLE = 'RMSE reduction on tubes never seen in fitting, % of the uncompensated'
_FEEDFORWARD = (
    ('bouc_wen', 'class', '73 to 76', 80.0),
    ('bouc_wen', 'size', '', None),
    ('asymmetric_bouc_wen', 'size', '', None),
    ('dahl', 'size', '', None),
    ('play', 'size', '', None),
    ('prandtl_ishlinskii', 'size', '', None),
    ('physical', 'size', '', 90.0),
    ('physical', 'plant', '', 90.0),
)
_FEEDBACK = (
    ('bouc_wen', 'class', 'adaptive', None),
    ('bouc_wen', 'class', 'recursive_least_squares', None),
    ('physical', 'plant', 'adaptive', None),
    ('adaptive_physical', 'plant', '', 95.0),
)


def rows(settings: PapersBench) -> list[Row]:
    """Both signals, both joints at once, feed-forward alone and with the 40 Hz tracker."""
    from endoscope_core.classifier.shipped import load_classifier
    from endoscope_core.control import (
        AdaptiveBacklashController,
        FeedforwardLaw,
        RecursiveHysteresisController,
    )
    from endoscope_core.errors import EndoscopeError
    from endoscope_core.identification.law_choice import LawChoice
    from endoscope_core.signals import non_periodic_signal, periodic_signal
    from endoscope_core.trials.never_seen_tube import calibrate, never_seen_tube
    from endoscope_core.trials.tracking_trial import run_tracking_trial

    classifier, choice = load_classifier(), LawChoice(2)
    reductions: dict[str, list[float]] = {}
    papers: dict[str, tuple[str, float | None]] = {}
    refused = 0
    for number in range(settings.tubes):
        tube = never_seen_tube(settings.seed, number)
        findings = calibrate(tube, classifier)
        for signal in (periodic_signal(), non_periodic_signal()):
            none = run_tracking_trial(tube.plant, signal, FeedforwardLaw(), False, tube.noise).rmse
            schemes: list[tuple[str, str, str | None, str, float | None]] = [
                (mode, by, None, paper, aim) for mode, by, paper, aim in _FEEDFORWARD
            ]
            schemes += [(mode, by, law, '', aim) for mode, by, law, aim in _FEEDBACK]
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
                reductions.setdefault(name, []).append(100.0 * (1.0 - trial.rmse / none))
        settings.report(f'compensators: tube {number + 1} of {settings.tubes}')
    note = f'{refused} refused: the calibration did not say enough.' if refused else ''
    return [
        Row(name, values, papers[name][0], at_least=papers[name][1], digits=1, note=note)
        for name, values in sorted(reductions.items())
    ]
