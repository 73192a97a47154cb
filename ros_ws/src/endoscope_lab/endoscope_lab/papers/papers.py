"""`endoscope bench papers`: the tables of both papers, compared with our figures."""

import argparse
import importlib

from endoscope_core.errors import InputError
from endoscope_lab.bench import chosen, report
from endoscope_lab.papers import calibrations, classification, compensation
from endoscope_lab.papers.row import PapersBench, table_text

FEWEST_CONFIGURATIONS = 5
TABLES = {
    'tension_by_shape': 'Table 1: RMSE of wire tension among shapes of like and of unlike '
    'hysteresis, N',
    'classifiers': 'First paper, table 3: class and backlash size from wire tensions',
    'nearest_class': 'Table 4: RMSE of the actual angle, class against colon shape, deg',
    'colon_shapes': 'Table 5: RMSE and backlash, none against compensated, deg',
    'compensators': 'RMSE left on tubes never seen in fitting, % of the uncompensated; signals '
    'scaled to 80 % of the bending range of the tube where that is less',
    'reach': 'Bending range identified by the 9 s calibration, to both sides, % off the true one',
    'changing_tube': 'Second paper: RMSE left of 60 sin t, % of the uncompensated, the tube bent '
    'at 10 s',
    'calibration_time': 'Calibration, from request to compensated motion, s',
    'real_sizes': 'Real recordings: backlash size from tension alone',
    'real_recordings': 'Real recordings (five tubes): identified on 1.3 cycles, judged on the rest '
    'of two, deg rms',
}
"""Titles of the tables, in the order of printing; `papers` has a function `NAME_rows` for each."""
OURS = {
    'load_cells': 'Calibrations with load cells as they are',
    'reading_rates': 'Calibrations with load cells that are read slowly',
}
"""Tables without a counterpart in the papers, printed on request."""


def run(args: argparse.Namespace) -> int:
    """Measure and print; return 0 if every aim is reached, else 1."""
    titles = chosen('table', args.only, TABLES | OURS) if args.only else TABLES
    if args.tubes < FEWEST_CONFIGURATIONS:
        raise InputError(
            f'--tubes {args.tubes}: a row needs at least {FEWEST_CONFIGURATIONS} tube '
            'configurations'
        )
    if 'classifiers' in titles:
        # Reports a missing PyTorch now rather than after the other tables.
        importlib.import_module('endoscope_lab.papers.networks')
    settings = PapersBench(args.seed, args.tubes, report, args.motion, args.weights)
    missed = 0
    print(f'seed {settings.seed}, {settings.tubes} tube configurations a row', flush=True)
    for name, title in titles.items():
        if name in OURS:
            print(f'\n{title}', flush=True)
            for line in getattr(calibrations, f'{name}_text')(settings):
                print(line, flush=True)
            continue
        module = compensation if hasattr(compensation, f'{name}_rows') else classification
        rows = getattr(module, f'{name}_rows')(settings)
        missed += sum(row.reached is False for row in rows)
        print(f'\n{title}\n{table_text(rows)}', flush=True)
    return 1 if missed else 0
