"""`endoscope bench kept`: what keeping the last seconds in memory costs the graph at 1 kHz."""

import argparse
import os
import tempfile
from collections import defaultdict

from endoscope_lab.graph import least_cores

TARGET_CORES = 0.03
_KEPT_S = 20.0
# Until the ring is full, and drops as much as it takes.
_SETTLING_S = _KEPT_S + 1.0
_RECORDERS: dict[str, dict[str, object]] = {
    'hears nothing': {'topics': ['nothing'], 'autostart': False, 'keep': 0.0},
    'hears all, keeps nothing': {'autostart': False, 'keep': 0.0},
    'keeps the last 20 s': {'autostart': False, 'keep': _KEPT_S},
    'records, keeps nothing': {'keep': 0.0},
    'records, keeps the last 20 s': {'keep': _KEPT_S},
}
"""Parameters of the recorder by what it does."""


def run(args: argparse.Namespace) -> int:
    """Print the figures; return 1 if keeping costs more than it may."""
    found: dict[str, list[float]] = defaultdict(list)
    # In turn, so that what else the machine does spoils all alike.
    for _ in range(args.rounds):
        for name, recorder in _RECORDERS.items():
            found[name].append(cores_of(recorder, args.seconds))
    cores = {name: min(values) for name, values in found.items()}
    for name, share in cores.items():
        print(f'{name:28}  {100 * share:5.1f} % of a core')
    _, heard, kept, recorded, both = cores.values()
    print(
        f'keeping costs {100 * (kept - heard):.1f} % of a core, {100 * (both - recorded):.1f} % '
        f'while it records; load average {os.getloadavg()[0]:.1f}'
    )
    return 0 if max(kept - heard, both - recorded) <= TARGET_CORES else 1


def cores_of(recorder: dict[str, object], seconds: float) -> float:
    """Least CPU time of all nodes in a second of a motion, with a recorder."""
    with tempfile.TemporaryDirectory() as folder:
        overrides: dict[str, dict[str, object]] = {
            'recorder': {'bag': f'{folder}/bag'} | recorder,
            'console': {'source': 'motion', 'motion': 'periodic'},
        }
        return least_cores(overrides, _SETTLING_S, seconds)
