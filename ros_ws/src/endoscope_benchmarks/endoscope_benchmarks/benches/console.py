"""`endoscope bench console`: how soon the slave stops, and what the console costs."""

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from endoscope_benchmarks.bench import (
    add_seconds,
    require_known,
    table_head,
    table_row,
    today_and_machine,
)
from endoscope_bringup.subcommands import COUNT

if TYPE_CHECKING:
    from endoscope_benchmarks.console_trials.events import Outcome
    from endoscope_benchmarks.console_trials.hand import Hand

_USUAL = ('dead-man let go', 'tab closed', 'network silent', 'network cut')
_COLUMNS = (
    'event',
    'N',
    'to the last change of motor/servo_jp [ms] median, 99 %, largest',
    'to clutch 0 [ms] median, 99 %, largest',
    'over 150 ms',
    'crept afterwards [mrad]',
    'load',
)
_AIM_MS = 150.0
# Without a load the last word of a motion comes within 0.05 s of the one that ends it.
_SETTLED_S, _WATCHED_S = 0.3, 0.3


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
        '--repetitions', type=COUNT, default=30, help='of each event (default: %(default)s)'
    )
    parser.add_argument('--only', nargs='+', metavar='EVENT', help='events to try; `all` for all')
    parser.add_argument(
        '--inputs',
        type=COUNT,
        default=30,
        help='inputs whose latency is taken (default: %(default)s)',
    )
    add_seconds(parser, 20.0, 'of each figure of cost')
    parser.add_argument(
        '--real-time',
        action='store_true',
        help='run the graph by the wall clock, with its deadlines',
    )


def run(args: argparse.Namespace) -> int:
    """Print a row for each event and a line for each other figure; 1 if something crept."""
    from endoscope_benchmarks.console_trials.costs import (
        costs_of_viewers,
        costs_with_browser,
        first_motion,
        input_latency,
    )
    from endoscope_benchmarks.console_trials.events import EVENTS
    from endoscope_benchmarks.console_trials.hand import Hand
    from endoscope_benchmarks.console_trials.relay import Relay
    from endoscope_benchmarks.console_trials.served_console import ServedConsole
    from endoscope_nodes.runtime.private_domain import private_domain

    names = tuple(EVENTS) if args.only == ['all'] else tuple(args.only or _USUAL)
    require_known('event', names, EVENTS)
    print(f'{"real" if args.real_time else "simulated"} time, {today_and_machine()}', flush=True)
    crept = 0
    began_s = time.monotonic()
    with (
        tempfile.TemporaryDirectory() as folder,
        Relay() as network,
        ServedConsole(
            Path(folder),
            private_domain(),
            (network.address,),
            real_time=args.real_time,
        ) as console,
    ):
        network.target = console.port
        with Hand(console, network) as hand:
            print(f'{first_motion(hand, began_s)}\n', flush=True)
            if args.repetitions:
                print(table_head(*_COLUMNS), flush=True)
            for name in names if args.repetitions else ():
                crept += _trials(name, hand, args.repetitions)
            if args.inputs:
                print()
                for line in input_latency(hand, args.inputs):
                    print(line, flush=True)
            if args.seconds:
                for line in costs_with_browser(hand, args.seconds):
                    print(line, flush=True)
        if args.seconds:
            for line in costs_of_viewers(console, args.seconds):
                print(line, flush=True)
    return 1 if crept else 0


def _trials(name: str, hand: 'Hand', repetitions: int) -> int:
    """Let an event happen again and again, and print its row; how often something crept."""
    from endoscope_benchmarks.console_trials.events import EVENTS, undergo
    from endoscope_benchmarks.console_trials.served_console import SAME_RAD

    outcomes: list[Outcome] = []
    try:
        for k in range(repetitions):
            print(f'\r{name} {k + 1} of {repetitions}', end='', file=sys.stderr, flush=True)
            outcomes.append(undergo(EVENTS[name], hand, _SETTLED_S, _WATCHED_S))
            EVENTS[name].is_over(hand)
    finally:
        # Hours of trials are not lost with a browser that ends.
        print('\r\x1b[K', end='', file=sys.stderr)
        if outcomes:
            print(_row(name, outcomes), flush=True)
    return sum(outcome.crept > SAME_RAD for outcome in outcomes)


def _row(name: str, outcomes: Sequence['Outcome']) -> str:
    loads = [outcome.load for outcome in outcomes]
    return table_row(
        name,
        len(outcomes),
        _spread([max(0.0, outcome.last_change_ms) for outcome in outcomes]),
        _spread([outcome.clutch_ms for outcome in outcomes]),
        sum(max(o.clutch_ms, o.last_change_ms) > _AIM_MS for o in outcomes),
        f'{1e3 * max(outcome.crept for outcome in outcomes):.1f}',
        f'{min(loads):.0f} to {max(loads):.0f}',
    )


def _spread(values: Sequence[float]) -> str:
    ordered = sorted(values)
    middle, late = ordered[len(ordered) // 2], ordered[len(ordered) * 99 // 100]
    return f'{middle:.0f}, {late:.0f}, {ordered[-1]:.0f}'
