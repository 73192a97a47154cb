"""`endoscope bench limits`: how weak an effect may be and still be named."""

import argparse

from endoscope_benchmarks.bench import add_jobs, add_seeds, require_known, side_by_side, table_row


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `limits`."""
    parser = subparsers.add_parser(
        'limits',
        help='how weak an effect may be and still be named',
        description='Makes each effect of the catalogue weaker by about a third at a time until it '
        'is not named on one of some rigs, and prints the last strength at which it was.',
    )
    parser.add_argument('--effects', nargs='+', metavar='ID', help='(default: all that are drawn)')
    add_seeds(parser, 'of the rigs (default: 1-3)')
    add_jobs(parser)


def run(args: argparse.Namespace) -> int:
    """Print a line for each effect; return 0."""
    from endoscope_benchmarks.concealed.forms import DRAWN
    from endoscope_benchmarks.concealed.trial import limit_of

    require_known('drawn effect', args.effects or (), DRAWN)
    calls = [(effect, args.seeds) for effect in args.effects or DRAWN]
    for _, future in side_by_side(args.jobs, limit_of, calls):
        found = future.result()
        named = f'{100.0 * found.share:.2g} %' if found.share == found.share else 'never'
        weaker = ', '.join(m or 'nothing' for m in found.missed_as) or '-'
        numbers = '; '.join(found.numbers)
        print(table_row(f'`{found.effect}`', named, numbers, weaker), flush=True)
    return 0
