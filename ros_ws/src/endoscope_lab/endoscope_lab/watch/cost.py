"""CPU time that watching the rig costs the graph at 1 kHz."""

import os
import tempfile
from pathlib import Path

import numpy as np

from endoscope_core.signals.sampled_motion import write_command_file
from endoscope_lab.graph import Composition, Pace, least_cores
from endoscope_nodes.graph import ALL_NODES

TARGET_CORES = 0.1
_ROUNDS, _SECONDS = 2, 10.0
_LEARNT_S = 45.0
"""Motion after which every block is judged."""


def run() -> int:
    """Print the figures; return 1 if watching costs more than it may."""
    cores: dict[bool, list[float]] = {False: [], True: []}
    # In turn, so that other load on the machine affects both alike.
    for _ in range(_ROUNDS):
        for watched, costs in cores.items():
            costs.append(_in_lock_step(watched, _SECONDS))
        for watched in cores:
            print(f'{"watched" if watched else "not watched"}: {_in_real_time(watched, _SECONDS)}')
    without, with_it = min(cores[False]), min(cores[True])
    print(
        f'{100 * without:.1f} % of a core without, {100 * with_it:.1f} % with it: watching costs '
        f'{100 * (with_it - without):.1f} %; load average {os.getloadavg()[0]:.1f}'
    )
    return 0 if with_it - without <= TARGET_CORES else 1


def _overrides(folder: str, watched: bool, seconds: float) -> dict[str, dict[str, object]]:
    motion = Path(folder) / 'motion.csv'
    at = np.arange(0.0, seconds, 0.01)
    angles = [0.3 * (np.sin(w * at) + np.sin(np.sqrt(3.0) * w * at)) for w in (1.0, 1.3)]
    write_command_file(motion, at, np.stack(angles, axis=1))
    return {
        'watch': {'active': watched},
        'recorder': {'bag': f'{folder}/bag', 'autostart': False},
        'master': {'source': 'file', 'command_file': str(motion)},
    }


def _in_lock_step(watched: bool, seconds: float) -> float:
    """Least CPU time of all nodes in one process for one second of motion."""
    with tempfile.TemporaryDirectory() as folder:
        return least_cores(_overrides(folder, watched, _LEARNT_S + seconds), _LEARNT_S, seconds)


def _in_real_time(watched: bool, seconds: float) -> Pace:
    with tempfile.TemporaryDirectory() as folder:
        overrides = _overrides(folder, watched, _LEARNT_S + seconds)
        with Composition(ALL_NODES, overrides) as graph:
            graph.enable()
            graph.serve(_LEARNT_S)
            return graph.kept_pace(seconds)
