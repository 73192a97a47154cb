"""`endoscope bench faults`: the slave when nodes die or stall and publishers compete."""

import argparse
import os
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from random import Random

from endoscope_lab.bench import chosen, spread, table_head, table_row, today_and_machine
from endoscope_lab.faults import motor_faults
from endoscope_lab.faults.process_faults import (
    COMPOSED_FAULTS,
    PROCESS_FAULTS,
    FaultResponse,
    undergo,
)
from endoscope_lab.faults.process_rig import ProcessRig
from endoscope_lab.faults.trace import STILL

_COLUMNS = (
    'fault',
    'N',
    'state before the next enable',
    'to standstill [ms] median, largest',
    'largest step of motor/servo_jp [mrad], share of its bound',
    'largest step of a shaft [mrad]',
    'largest speed of a shaft [rad/s]',
    'largest motion without enable [mrad]',
    'enable to motion [s] median, largest',
    'recording',
    'load',
)
# The bound of a step, with rounding.
_SHARE = 1.001


def run(args: argparse.Namespace) -> int:
    """Print a row for each fault; return 1 if anything moved without a command."""
    if args.motors:
        return motor_faults.run(args.only)
    faults = chosen('fault', args.only, COMPOSED_FAULTS if args.composed else PROCESS_FAULTS)
    print(
        f'{"one process" if args.composed else "a process for each node"}, {args.rate} Hz, seed '
        f'{args.seed}, {today_and_machine()}\n\n{table_head(*_COLUMNS)}',
        flush=True,
    )
    wrong = 0
    random = Random(args.seed)
    with (
        tempfile.TemporaryDirectory() as folder,
        ProcessRig(args.rate, args.composed, Path(folder), random) as rig,
    ):
        for name, fault in faults.items():
            outcomes, loads = [], []
            for _ in range(args.repetitions):
                outcomes.append(undergo(fault, rig))
                loads.append(os.getloadavg()[0])
            print(_row(name, outcomes, loads), flush=True)
            wrong += sum(map(_is_wrong, outcomes))
    return 1 if wrong else 0


def _is_wrong(outcome: FaultResponse) -> bool:
    return outcome.unasked > STILL or outcome.goal_share > _SHARE or outcome.enabled_s is None


def _row(name: str, outcomes: Sequence[FaultResponse], loads: Sequence[float]) -> str:
    states = Counter(outcome.state for outcome in outcomes)
    ended = sum(len(outcome.before) for outcome in outcomes)
    still = [o.still_s * 1e3 for o in outcomes if o.still_s is not None]
    enabled = [o.enabled_s for o in outcomes if o.enabled_s is not None]
    never = len(outcomes) - len(enabled)
    missing = max(0.0, *(o.bag for o in outcomes))
    lost = sum(max(0.0, -o.bag) for o in outcomes)
    step = max(o.goal_step for o in outcomes)
    return table_row(
        name,
        len(outcomes),
        ', '.join(f'{state} {n}' for state, n in states.most_common())
        + (f'; ended before the fault {ended}' if ended else ''),
        _middle_and_most(still, '.0f'),
        f'{1e3 * step:.1f}, {max(o.goal_share for o in outcomes):.2f}',
        f'{1e3 * max(o.shaft_step for o in outcomes):.1f}',
        f'{max(o.shaft_speed for o in outcomes):.2f}',
        f'{1e3 * max(o.unasked for o in outcomes):.1f}',
        _middle_and_most(enabled, '.1f') + (f'; {never} never' if never else ''),
        f'complete to {missing:.2f} s before' if missing else f'{lost:.0f} lost',
        f'{min(loads):.0f} to {max(loads):.0f}',
    )


def _middle_and_most(values: Sequence[float], form: str) -> str:
    if not values:
        return '-'
    middle, _, most = spread(values)
    return f'{middle:{form}}, {most:{form}}'
