"""Backlash sizes of a real rig from its tensions alone, each configuration left out in turn."""

import os
from pathlib import Path

import numpy as np

from endoscope_bringup.benches.papers_tables.row import PapersBench, Row

TITLE = 'Real recordings: backlash size from tension alone, leave one configuration out'

_PERIOD = (0.5 * np.pi, 2.5 * np.pi)
_TIME, _DESIRED, _ACTUAL, _POSITIVE, _NEGATIVE = 0, 1, 3, 4, 5


def rows(settings: PapersBench) -> list[Row]:
    """One row, or none where the recordings are not at hand."""
    from endoscope_core.metrics import width_at_mid_height
    from endoscope_core.metrics.tension_loop import leave_one_out_errors, tension_loop_width

    shared = os.environ.get('ENDOSCOPE_SHARED')
    folder = Path(shared or Path(__file__).parents[7] / 'shared') / 'data' / 'kaist'
    paths = sorted(folder.glob('*.txt'))
    if not paths:
        settings.report(f'no recordings in {folder}; set ENDOSCOPE_SHARED')
        return []
    sizes, widths = [], []
    for path in paths:
        table = np.loadtxt(path, delimiter=',')
        # The rows repeat each reading of a slower clock.
        table = table[np.diff(table[:, _TIME], prepend=-1.0) != 0.0]
        first, last = np.searchsorted(table[:, _TIME], _PERIOD)
        loop = table[first:last]
        desired = loop[:, _DESIRED]
        sizes.append(width_at_mid_height(desired, loop[:, _ACTUAL]))
        widths.append(tension_loop_width(desired, loop[:, _POSITIVE], loop[:, _NEGATIVE]))
    errors = leave_one_out_errors(widths, sizes)
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
