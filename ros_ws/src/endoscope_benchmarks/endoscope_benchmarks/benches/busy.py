"""`endoscope bench busy`: the first session and the console's first minutes on a busy machine."""

import argparse
import os
import tempfile
import time
from pathlib import Path

from endoscope_benchmarks.bench import table_head, table_row
from endoscope_bringup.subcommands import COUNT, within


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `busy`."""
    parser = subparsers.add_parser(
        'busy',
        help='the first session and the console beside busy programs',
        description='Starts busy loops, then again and again the session of README in a shell, '
        'and the console with a real Chromium: take the controls, enable, calibrate, move, go '
        'home. Then the simulated slave plays a motion for a while beside Chromium and two busy '
        'loops, recorded. Exits 1 where a step failed, a fault came or a message was lost.',
    )
    parser.add_argument('--n', type=COUNT, default=20, metavar='N', help='of each (20)')
    parser.add_argument(
        '--loops', type=within(0, 64, int), default=7, metavar='N', help='busy loops (7)'
    )
    parser.add_argument(
        '--minutes',
        type=within(0.0, 1440.0, float),
        default=30.0,
        metavar='M',
        help='of the long motion (30)',
    )


def run(args: argparse.Namespace) -> int:
    """Print a line for each trial and a table; return 1 if one of them failed."""
    from endoscope_benchmarks.console_trials.first_minutes import (
        busy_loops,
        console_trial,
        long_motion,
        shell_trial,
    )
    from endoscope_nodes.runtime.private_domain import private_domain

    domain = private_domain()
    rows: dict[str, list[str]] = {'shell': [], 'console': []}
    with busy_loops(args.loops):
        for k in range(args.n):
            for name, trial in (('shell', shell_trial), ('console', console_trial)):
                began, load = time.monotonic(), os.getloadavg()[0]
                with tempfile.TemporaryDirectory() as folder:
                    trouble = trial(Path(folder), domain)
                rows[name].append(trouble)
                took = time.monotonic() - began
                said = trouble or 'every step'
                print(
                    f'{name} {k + 1} of {args.n}: {said} ({took:.0f} s, load {load:.1f})',
                    flush=True,
                )
    failed = any(map(any, rows.values()))
    if args.minutes > 0.0:
        with busy_loops(2), tempfile.TemporaryDirectory() as folder:
            row = long_motion(Path(folder), domain, 60.0 * args.minutes)
        failed |= bool(row.trouble)
        print(
            f'{args.minutes:g} min beside Chromium and two loops: {row.trouble or "no fault"}, '
            f'{row.lost} lost of {row.recorded}, real-time factor {row.factors[0]:.2f} to '
            f'{row.factors[-1]:.2f}, median {row.factors[len(row.factors) // 2]:.2f}'
        )
    if args.n:
        print(table_head('session', 'trials', 'every step'))
        for name, troubles in rows.items():
            print(table_row(name, len(troubles), troubles.count('')))
    return int(failed)
