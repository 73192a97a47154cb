"""The demonstration as a whole: all tubes, their recordings, and the report."""

import json
import os
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from endoscope_bringup.demo.procedure import TUBES, RecordedTube, Tube
from endoscope_bringup.demo.report_page import report_page
from endoscope_bringup.demo.results import DemoResults, analyse, table_rows
from endoscope_core.atomic_output import write_text
from endoscope_core.workers import worker_pool

REPORT = 'report.html'
FIGURES = 'figures.json'

# Domains above 101 have ports that Linux gives to others.
DOMAINS = 102


def run_demo(
    folder: Path,
    *,
    tubes: Sequence[Tube] = TUBES,
    seed: int,
    real_time: bool,
    progress: Callable[[str], None],
) -> DemoResults:
    """Run the procedure on every tube; all that is written goes into an existing folder."""
    # The same seed of the sensors' noise gives the same bags, unless `real_time` runs by the wall
    # clock instead of in lock-step on /clock. `progress` must be picklable.
    began = time.monotonic()
    progress('loading the nodes, which takes some seconds')
    procedure = partial(_run_tube, folder=folder, seed=seed, real_time=real_time, progress=progress)
    # Graphs that share two cores would be late by the wall clock.
    recordings = _run_tubes(tubes, procedure, side_by_side=not real_time)
    progress('reading the recordings back and drawing the report')
    results = analyse(
        {tube.name: made.bag for tube, made in zip(tubes, recordings, strict=True)},
        [segment for made in recordings for segment in made.segments],
        [made.calibration for made in recordings],
        _summed_losses(recordings),
    )
    facts = {
        'date': datetime.now(UTC).strftime('%Y-%m-%d %H:%M UTC'),
        'command': 'endoscope demo' + (' --real-time' if real_time else '') + f' --seed {seed}',
        'time': 'wall clock' if real_time else 'simulated, in lock-step on /clock',
        'took': f'{time.monotonic() - began:.0f} s',
        'recordings': ', '.join(made.bag.name for made in recordings),
    }
    write_text(folder / REPORT, report_page(results, facts))
    write_text(
        folder / FIGURES,
        json.dumps(
            {
                'facts': facts,
                'calibrations': [asdict(made.calibration) for made in recordings],
                'segments': [asdict(s) for made in recordings for s in made.segments],
                'table': [asdict(row) for row in table_rows(results)],
            },
            indent=2,
        )
        + '\n',
    )
    return results


def _run_tubes(
    tubes: Sequence[Tube], procedure: Callable[..., RecordedTube], side_by_side: bool
) -> list[RecordedTube]:
    """Run tubes, side by side in processes of their own, each in its own ROS domain."""
    here = int(os.environ.get('ROS_DOMAIN_ID', '0'))
    if not side_by_side or len(tubes) == 1:
        return [procedure(tube, domain=here) for tube in tubes]
    with worker_pool(len(tubes)) as pool:
        runs = [
            pool.submit(procedure, tube, domain=(here + n) % DOMAINS)
            for n, tube in enumerate(tubes)
        ]
        return [run.result() for run in runs]


def _run_tube(tube: Tube, **how: Any) -> RecordedTube:
    # Imported by the process that runs the nodes alone: it takes seconds.
    from endoscope_bringup.demo.run_tube import run_tube

    return run_tube(tube, **how)


def _summed_losses(recordings: Sequence[RecordedTube]) -> dict[str, int]:
    losses: Counter[str] = Counter()
    for recording in recordings:
        losses.update(recording.lost)
    return dict(losses)
