"""`endoscope bench mistakes`: whether what people take wrongly is said, and nothing else."""

import argparse
from concurrent.futures import Executor
from pathlib import Path

from endoscope_benchmarks.bench import add_jobs, add_seeds, table_head, table_row


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `mistakes`."""
    parser = subparsers.add_parser(
        'mistakes',
        help='audit recordings in which something was taken wrongly',
        description='Draws a recording of each kind of mistake for every seed and prints what was '
        'not said rightly; then right recordings, and prints what was said of them. '
        'Seeds from 1 to 99 are for development; of others, first runs are reported.',
    )
    add_seeds(parser, 'of mistakes (1)', last=1)
    add_seeds(parser, 'of right ones (1-10)', '--sound', last=10)
    parser.add_argument(
        '--derive', action='store_true', help='derive the deciding numbers from the right ones'
    )
    parser.add_argument('--write', type=Path, metavar='FILE', help='module for them')
    add_jobs(parser)


def run(args: argparse.Namespace) -> int:
    """Print what was not said rightly and a table, or the numbers; return 0."""
    from endoscope_core.workers import worker_pool

    with worker_pool(args.jobs) as pool:
        if args.derive:
            _derive(args, pool)
        else:
            _measure(args, pool)
    return 0


def _measure(args: argparse.Namespace, pool: Executor) -> None:
    from endoscope_benchmarks.mistakes.mistake import MISTAKES, audited

    cases = [(name, seed) for name in MISTAKES for seed in args.seeds]
    cases += [('', seed) for seed in args.sound]
    rows = []
    for row in pool.map(audited, *zip(*cases, strict=True)):
        rows.append(row)
        if not row.right:
            print(f'{row.name or "no mistake"}, seed {row.seed}: {"; ".join(row.said) or "-"}')
    wrong = [row for row in rows if row.name]
    sound = [row for row in rows if not row.name]
    right = sum(row.right for row in wrong)
    missed = sum(not row.mistaken for row in wrong)
    slowest = max(row.seconds for row in rows)
    cells = {
        'mistakes': len(wrong),
        'said rightly': f'{right} ({right / max(len(wrong), 1):.1%})',
        'missed': missed,
        'otherwise': len(wrong) - right - missed,
        'none': len(sound),
        'false alarms': sum(not row.right for row in sound),
        'slowest': f'{slowest:.1f} s',
    }
    print(table_head(*cells))
    print(table_row(*cells.values()))


def _derive(args: argparse.Namespace, pool: Executor) -> None:
    from endoscope_benchmarks.mistakes import deriving
    from endoscope_core.atomic_output import write_text
    from endoscope_core.errors import EndoscopeError

    try:
        partly = deriving.without_worth(list(pool.map(deriving.seen, args.sound)))
        worths = list(pool.map(deriving.least_worth, args.sound, [partly] * len(args.sound)))
        criteria = deriving.derived(partly, worths)
    except ValueError as error:
        raise EndoscopeError(str(error)) from error
    first, last = min(args.sound), max(args.sound)
    made_by = f'`endoscope bench mistakes --derive`, seeds {first} to {last}'
    print(deriving.source(criteria, made_by))
    print(deriving.sensitivity(criteria, worths))
    if args.write:
        write_text(args.write, deriving.source(criteria, made_by))
