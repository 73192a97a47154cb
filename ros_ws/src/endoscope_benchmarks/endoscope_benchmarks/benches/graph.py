"""`endoscope bench graph`: whether the node graph keeps its pace, in one process and in many."""

import argparse

from endoscope_benchmarks.bench import add_seconds

PROCESS_RATES = (1000, 500, 250, 125)


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `graph`."""
    parser = subparsers.add_parser(
        'graph',
        help='ticks, latency and CPU time of the node graph',
        description='Runs all nodes on the simulated slave: in one process in real time, with a '
        'recorder; in lock-step as fast as it goes; and each in a process of its own at falling '
        'rates until one is carried. Exits 1 where a target is missed.',
    )
    add_seconds(parser, 60.0, 'length of the run in one process')
    add_seconds(
        parser, 10.0, 'length of each run in many processes, 0 for none', '--process-seconds'
    )


def run(args: argparse.Namespace) -> int:
    """Print the figures; return 1 if a target is missed."""
    from endoscope_benchmarks.benches.composed_graph import (
        TARGET_LOCK_STEP,
        run_graph_bench,
        run_lock_step_bench,
    )
    from endoscope_benchmarks.benches.graph_processes import run_processes_bench

    composed = run_graph_bench(args.seconds)
    print(composed, flush=True)
    speed = run_lock_step_bench(min(args.seconds, 20.0))
    print(f'lock-step: {speed:.1f} times real time', flush=True)
    if args.process_seconds:
        for rate in PROCESS_RATES:
            figure = run_processes_bench(rate, args.process_seconds)
            print(figure, flush=True)
            if figure.carried:
                break
    return 0 if composed.reached and speed >= TARGET_LOCK_STEP else 1
