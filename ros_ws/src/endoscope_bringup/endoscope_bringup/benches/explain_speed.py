"""How long one explanation takes, and how much memory, in a process of its own."""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from endoscope_explain.benchmark.figures_of_merit import Figure
from endoscope_explain.generator import draw_case, write_case

LIMIT_S = 60.0
LIMIT_BYTES = 2e9


def measure_speed(seed: int, jobs: int) -> list[Figure]:
    """Explain one 40 s recording of both joints as a user would.

    Parameters
    ----------
    seed : int
        Chooses the case.
    jobs : int
        Processes of the explanation.

    Returns
    -------
    list of Figure
        Wall time, and the memory of the largest process.

    Raises
    ------
    subprocess.CalledProcessError
        If the explanation fails.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        bag = write_case(draw_case(seed, 'single'), folder)
        begun = time.monotonic()
        subprocess.run(
            [
                sys.executable,
                '-m',
                'endoscope_bringup.cli',
                'explain',
                str(bag),
                '--plant',
                str(folder / 'plant.yaml'),
                '--out',
                str(folder / 'out'),
                '--jobs',
                str(jobs),
            ],
            check=True,
            capture_output=True,
        )
        wall = time.monotonic() - begun
    largest = 1024.0 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    return [
        Figure(
            'time for 40 s, both joints, all effects',
            f'{wall:.0f} s',
            'at most 60 s',
            wall <= LIMIT_S,
        ),
        Figure(
            'memory of its largest process',
            f'{largest / 1e9:.2f} GB',
            'at most 2 GB',
            largest <= LIMIT_BYTES,
        ),
    ]
