"""`endoscope bench NAME`: measures a figure of the documentation on this machine."""

import argparse

from endoscope_benchmarks.benches import BENCHES
from endoscope_bringup.subcommands import add_subcommands, run_chosen


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `bench` with one subparser for each module of `endoscope_benchmarks.benches`."""
    parser = subparsers.add_parser(
        'bench', help='measure a figure of the documentation on this machine'
    )
    add_subcommands(
        parser, [f'endoscope_benchmarks.benches.{name}' for name in BENCHES], dest='bench'
    )


def run(args: argparse.Namespace) -> int:
    """Run the chosen bench and return its exit status."""
    return run_chosen(args, dest='bench')
