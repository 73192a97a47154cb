"""`endoscope bench real_rig`: a real endoscope in several shapes, explained and judged."""

import argparse
import tempfile
from pathlib import Path


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `real_rig`."""
    parser = subparsers.add_parser(
        'real_rig',
        help='explain the recordings of a real endoscope, where they are at hand',
        description='Explains the recordings of a real flexible endoscope in five shapes of its '
        'tube from their first cycle, all together, and judges on the second one. They are looked '
        'for in data/kaist of the folder that ENDOSCOPE_SHARED names.',
    )
    parser.add_argument('--jobs', type=int, default=2, help='processes side by side (2)')


def run(args: argparse.Namespace) -> int:
    """Run and print; return 0 if every angle is below those of the models of the angle alone."""
    import numpy as np

    from endoscope_core.trials.real_recordings import recordings_folder
    from endoscope_explain.benchmark.real_rig import MODELS, explained_rig

    folder = recordings_folder()
    if folder is None:
        print('no recordings of a real endoscope: set ENDOSCOPE_SHARED to the folder that has them')
        return 2
    tables = sorted(folder.glob('*.txt'), key=lambda path: int(path.stem))
    with tempfile.TemporaryDirectory() as scratch:
        tubes = explained_rig(
            tables, Path(scratch), args.jobs, lambda line: print(line, flush=True)
        )
    print('second cycle, rms: angle in deg as measured, tensions in N')
    print('tube   refitted          explained         ' + '  '.join(MODELS) + '  verdict')
    for tube in tubes:
        columns = [
            f'{np.rad2deg(misfit.angle):.2f} ' + ' '.join(f'{t:.2f}' for t in misfit.tensions)
            for misfit in (tube.refitted, tube.explained)
        ]
        models = '  '.join(
            f'{np.rad2deg(tube.models[name]):.2f}'.ljust(len(name)) for name in MODELS
        )
        print(f'{tube.name:5s}  ' + '    '.join(columns) + f'    {models}  {tube.verdict}')
    for tube in tubes:
        print(f'{tube.name}: {", ".join(tube.effects)}')
        print('    ' + ', '.join(f'{name} {value:.4g}' for name, value in tube.numbers.items()))
    below = all(tube.explained.angle < min(tube.models.values()) for tube in tubes)
    return 0 if below else 1
