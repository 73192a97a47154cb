"""`endoscope bench console`: how soon the slave stops, and what the console costs."""

import argparse
import os
import platform
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from endoscope_benchmarks.console_trials.events import Outcome

_USUAL = ('dead-man let go', 'tab closed', 'network silent', 'network cut')
_HEADING = (
    '| event | N | to the last change of motor/servo_jp [ms] median, 99 %, largest '
    '| to clutch 0 [ms] median, 99 %, largest | crept afterwards [mrad] | load |\n'
    '|---|---|---|---|---|---|'
)
_SIMULATED = '-p use_sim_time:=true -p speed:=1.0'


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `console`."""
    parser = subparsers.add_parser(
        'console',
        help='how soon the slave stops whatever happens to the page, and what the console costs',
        description='Starts `endoscope console` with its graph and a real Chromium in which a key '
        'is held, lets one thing after the other happen to the page, and prints a table; then '
        'the latency of an input, CPU time of the server, ticks of the graph with viewers and '
        'frames of the page. Exits 1 where something moved without a new grip.',
    )
    parser.add_argument(
        '--repetitions', type=int, default=30, help='of each event (default: %(default)s)'
    )
    parser.add_argument('--only', nargs='+', metavar='EVENT', help='events to try; `all` for all')
    parser.add_argument(
        '--inputs',
        type=int,
        default=30,
        help='inputs whose latency is taken (default: %(default)s)',
    )
    parser.add_argument(
        '--seconds', type=float, default=20.0, help='of each figure of cost (default: %(default)g)'
    )
    parser.add_argument(
        '--simulated-time',
        action='store_true',
        help='no faster than real time, but without its deadlines: for a machine that is busy',
    )


def run(args: argparse.Namespace) -> int:
    """Print a row for each event and a line for each other figure; 1 if something crept."""
    from endoscope_benchmarks.console_trials.costs import (
        costs_of_viewers,
        costs_with_browser,
        input_latency,
    )
    from endoscope_benchmarks.console_trials.events import EVENTS, undergo
    from endoscope_benchmarks.console_trials.hand import Hand
    from endoscope_benchmarks.console_trials.relay import Relay
    from endoscope_benchmarks.console_trials.served_console import SAME_RAD, ServedConsole
    from endoscope_core.errors import EndoscopeError

    names = tuple(EVENTS) if args.only == ['all'] else tuple(args.only or _USUAL)
    for name in names:
        if name not in EVENTS:
            raise EndoscopeError(f"no event '{name}'; known are {', '.join(EVENTS)}")
    print(
        f'{"simulated" if args.simulated_time else "real"} time, {time.strftime("%Y-%m-%d")}, '
        f'{os.cpu_count()} cores, {platform.processor() or platform.machine()}\n\n{_HEADING}',
        flush=True,
    )
    crept = 0
    with (
        tempfile.TemporaryDirectory() as folder,
        Relay() as network,
        ServedConsole(
            Path(folder),
            100 + os.getpid() % 130,
            _SIMULATED if args.simulated_time else '',
            (network.address,),
        ) as console,
    ):
        network.target = console.port
        costs = list(costs_of_viewers(console, args.seconds)) if args.seconds else []
        with Hand(console, network) as hand:
            for name in names if args.repetitions else ():
                outcomes = []
                for _ in range(args.repetitions):
                    outcomes.append(undergo(EVENTS[name], hand, 0.3))
                    EVENTS[name].is_over(hand)
                print(_row(name, outcomes), flush=True)
                crept += sum(outcome.crept > SAME_RAD for outcome in outcomes)
            if args.inputs:
                print()
                for line in input_latency(hand, args.inputs):
                    print(line, flush=True)
            if args.seconds:
                for line in (*costs, *costs_with_browser(hand, args.seconds)):
                    print(line, flush=True)
    return 1 if crept else 0


def _row(name: str, outcomes: Sequence['Outcome']) -> str:
    loads = [outcome.load for outcome in outcomes]
    columns = (
        name,
        f'{len(outcomes)}',
        _spread([max(0.0, outcome.last_change_ms) for outcome in outcomes]),
        _spread([outcome.clutch_ms for outcome in outcomes]),
        f'{1e3 * max(outcome.crept for outcome in outcomes):.1f}',
        f'{min(loads):.0f} to {max(loads):.0f}',
    )
    return f'| {" | ".join(columns)} |'


def _spread(values: Sequence[float]) -> str:
    ordered = sorted(values)
    middle, late = ordered[len(ordered) // 2], ordered[len(ordered) * 99 // 100]
    return f'{middle:.0f}, {late:.0f}, {ordered[-1]:.0f}'
