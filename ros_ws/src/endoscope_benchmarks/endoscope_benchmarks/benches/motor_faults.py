"""`endoscope bench motor_faults`: what the slave does when motors or master fail, and how fast."""

import argparse
import re
import tempfile
from pathlib import Path

from endoscope_benchmarks.bench import add_only, chosen, table_head

_COLUMNS = (
    'fault',
    'state',
    'to FAULT [ms]',
    'to standstill [ms]',
    'longest gap of motor/measured_js [ms]',
    'largest error in the bag [mrad]',
    'FAULT in the bag',
    'cause',
)


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `motor_faults`."""
    parser = subparsers.add_parser(
        'motor_faults',
        help='what the slave does when motors or master fail, and how fast',
        description='Runs master, compensator, motor driver, supervisor and recorder on emulated '
        'servos, breaks one thing after the other in motion, and prints a table. Exits 1 '
        'where the slave does not end as it must.',
    )
    add_only(parser, 'fault')


def run(args: argparse.Namespace) -> int:
    """Print a row for each fault; return 1 if one ended otherwise than it must."""
    from endoscope_benchmarks.device_faults.motor_faults import MOTOR_FAULTS, undergo

    faults = chosen('fault', args.only, MOTOR_FAULTS)
    wrong = 0
    print(table_head(*_COLUMNS))
    for fault in faults.values():
        with tempfile.TemporaryDirectory() as folder:
            outcome = undergo(fault, Path(folder))
        print(outcome, flush=True)
        ended = outcome.state == fault.ends_in and bool(re.search(fault.cause, outcome.cause))
        wrong += not ended or (fault.stops and outcome.stopped_s is None)
    return 1 if wrong else 0
