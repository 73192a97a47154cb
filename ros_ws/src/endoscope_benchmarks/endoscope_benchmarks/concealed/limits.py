"""`endoscope bench limits`: how weak an effect may be and still be named."""

import argparse

from endoscope_benchmarks.bench import require_known, side_by_side, table_row
from endoscope_benchmarks.concealed.forms import DRAWN
from endoscope_benchmarks.concealed.trial import limit_of


def run(args: argparse.Namespace) -> int:
    """Print a line for each effect; return 0."""
    require_known('drawn effect', args.effects or (), DRAWN)
    calls = [(effect, args.seeds) for effect in args.effects or DRAWN]
    for _, future in side_by_side(args.jobs, limit_of, calls):
        found = future.result()
        named = f'{100.0 * found.share:.2g} %' if found.share == found.share else 'never'
        weaker = ', '.join(m or 'nothing' for m in found.missed_as) or '-'
        numbers = '; '.join(found.numbers)
        print(table_row(f'`{found.effect}`', named, numbers, weaker), flush=True)
    return 0
