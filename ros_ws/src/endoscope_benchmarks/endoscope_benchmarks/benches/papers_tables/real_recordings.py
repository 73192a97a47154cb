"""Real recordings of a flexible endoscope: each model, and the table with one tube left out."""

from endoscope_benchmarks.benches.papers_tables.row import PapersBench, Row

TITLE = 'Real recordings (five tubes): identified on the first cycle, judged on the second, deg rms'
_GIVEN = {'play': '1.34 at 0', 'bouc_wen': '1.02 at 0', 'prandtl_ishlinskii': '1.01 at 0'}


def rows(settings: PapersBench) -> list[Row]:
    """Empty, with a line that says why, where the recordings are not there."""
    import numpy as np

    from endoscope_benchmarks.trials.real_recordings import (
        left_one_out,
        models_on_real_recordings,
        real_recordings,
    )
    from endoscope_core.hysteresis.inverse import MODELS

    recordings = real_recordings()
    if not recordings:
        settings.report('real recordings: none found (ENDOSCOPE_SHARED or shared/data/kaist)')
        return []
    limits = {'play': 1.34, 'bouc_wen': 1.02, 'prandtl_ishlinskii': 1.01}
    found = []
    for model in MODELS:
        second = models_on_real_recordings(recordings, model, settings.seed)
        for bend, (fitted, judged) in second.items():
            found.append(
                Row(
                    f'{model}, tube bent {bend} deg (first cycle {np.rad2deg(fitted):.2f})',
                    [float(np.rad2deg(judged))],
                    _GIVEN.get(model, '') if bend == 0 else '',
                    at_most=limits.get(model) if bend == 0 else None,
                )
            )
    for model in ('play', 'bouc_wen'):
        outcomes = left_one_out(recordings, model, settings.seed)
        known = [outcome for outcome in outcomes if outcome.left is not None]
        for outcome in known:
            found.append(
                Row(
                    f'{model} by table, {outcome.bend} deg left out: model error rms '
                    f'(uncompensated {np.rad2deg(outcome.uncompensated):.1f})',
                    [float(np.rad2deg(outcome.left or 0.0))],
                )
            )
        refused = [str(outcome.bend) for outcome in outcomes if outcome.left is None]
        if refused:
            settings.report(f'{model} table refuses the tubes of {", ".join(refused)} deg')
    return found
