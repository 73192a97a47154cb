"""Backlash sizes of a real rig from its tensions alone, each configuration left out in turn."""

import numpy as np

from endoscope_benchmarks.benches.papers_tables.row import PapersBench, Row

TITLE = 'Real recordings: backlash size from tension alone, leave one configuration out'


def rows(settings: PapersBench) -> list[Row]:
    """One row, or none where the recordings are not at hand."""
    from endoscope_benchmarks.trials.real_recordings import real_recordings
    from endoscope_benchmarks.trials.tension_loop import leave_one_out_errors

    recordings = real_recordings()
    if not recordings:
        settings.report('no recordings at hand; set ENDOSCOPE_SHARED')
        return []
    sizes = [float(np.rad2deg(recording.backlash_size)) for recording in recordings]
    errors = leave_one_out_errors([recording.tension_width for recording in recordings], sizes)
    note = 'errors of each: ' + ', '.join(f'{e:+.1f}' for e in errors)
    return [
        Row(
            'rms error [deg]',
            [float(np.sqrt(np.mean(errors**2)))],
            '3.4 (two features picked by hand)',
            at_most=3.4,
            note=note,
        )
    ]
