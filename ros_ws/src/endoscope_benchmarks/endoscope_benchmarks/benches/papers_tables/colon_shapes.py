"""Table 5 of the first paper: the two colon shapes, compensated and not."""

from endoscope_benchmarks.benches.papers_tables.row import PapersBench, Row

TITLE = 'Table 5: RMSE and backlash, none against compensated, deg'
_PAPER = {
    ('descending', 'periodic'): ('18.08 ± 0.35', '4.65 ± 0.13', '50.02 ± 1.16', '10.77 ± 0.48'),
    ('descending', 'non_periodic'): (
        '23.64 ± 0.08',
        '6.34 ± 0.18',
        '56.88 ± 1.26',
        '11.47 ± 0.71',
    ),
    ('transverse', 'periodic'): ('25.95 ± 0.60', '6.99 ± 0.65', '68.48 ± 0.77', '17.05 ± 0.16'),
    ('transverse', 'non_periodic'): (
        '26.78 ± 0.13',
        '6.33 ± 0.18',
        '70.55 ± 0.51',
        '17.68 ± 0.10',
    ),
}
# Under the calibration sinusoid; tubes of the family of these sizes have the paper's backlash under
# `60 sin t`.
_SIZES_DEG = {'descending': 55.0, 'transverse': 73.0}
_SCHEMES = ('none', 'Bouc-Wen of the class', 'physical inverse')


def rows(settings: PapersBench) -> list[Row]:
    """Track both signals uncompensated, as the paper does it, and by the physical inverse."""
    import numpy as np

    from endoscope_benchmarks.trials.never_seen_tube import (
        backlash_left,
        calibrate,
        never_seen_tube,
    )
    from endoscope_benchmarks.trials.tracking_trial import run_tracking_trial
    from endoscope_core.classifier.weights_file import load_classifier
    from endoscope_core.control import FeedforwardLaw
    from endoscope_core.identification.law_choice import LawChoice
    from endoscope_core.signals import non_periodic_signal, periodic_signal

    classifier, choice = load_classifier(), LawChoice(2)
    signals = (periodic_signal(), non_periodic_signal())
    rmse: dict[tuple[str, str, str], list[float]] = {}
    left: dict[tuple[str, str, str], list[float]] = {}
    for shape, size_deg in _SIZES_DEG.items():
        for number in range(settings.tubes):
            tube = never_seen_tube(settings.seed, number, size_deg)
            findings = calibrate(tube, classifier)
            laws = {_SCHEMES[0]: FeedforwardLaw()}
            if findings.class_deg is not None:
                laws[_SCHEMES[1]] = choice.law('bouc_wen', 'class', findings)
            laws[_SCHEMES[2]] = choice.law('physical', 'plant', findings)
            for signal in signals:
                for scheme, law in laws.items():
                    key = shape, signal.name, scheme
                    trial = run_tracking_trial(tube.plant, signal, law, False, tube.noise)
                    rmse.setdefault(key, []).append(float(np.rad2deg(trial.rmse)))
                    width = float(np.rad2deg(backlash_left(trial, signal)))
                    left.setdefault(key, []).append(width)
            settings.report(f'table 5: {shape} colon, tube {number + 1} of {settings.tubes}')
    found = []
    for (shape, signal_name), papers in _PAPER.items():
        for figure, values, offset in (('RMSE', rmse, 0), ('backlash', left, 2)):
            for scheme in _SCHEMES:
                key = shape, signal_name, scheme
                if key in values:
                    found.append(
                        Row(
                            f'{shape}, {signal_name}, {figure}, {scheme}',
                            values[key],
                            papers[offset + (scheme != 'none')],
                            at_most=5.0 if figure == 'backlash' and scheme != 'none' else None,
                        )
                    )
    return found
