"""`endoscope convert`: a text table of measurements to a bag."""

import argparse
from pathlib import Path


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `convert`."""
    parser = subparsers.add_parser(
        'convert',
        help='turn a text table of measurements into a bag',
        description='Writes the columns of TABLE, described by a mapping file, as topics of a bag. '
        'Rows whose time is that of the row before are dropped, unless the mapping says that the '
        'table was written faster than its sources (sample_and_hold): then a topic has a message '
        'where one of its columns changes.',
    )
    parser.add_argument('table', type=Path, metavar='TABLE', help='text, one row a sample')
    parser.add_argument(
        '--mapping',
        type=Path,
        required=True,
        metavar='M.yaml',
        help='which column is which topic, quantity, joint and unit',
    )
    parser.add_argument(
        '--out',
        type=Path,
        required=True,
        metavar='BAG',
        help='where to write: a bare file if it ends in .mcap, else a folder',
    )


def run(args: argparse.Namespace) -> int:
    """Convert and write; return 0."""
    from endoscope_bags.table_mapping import load_table_mapping
    from endoscope_bags.text_table import convert_table

    done = convert_table(args.table, load_table_mapping(args.mapping), args.out)
    print(
        f'{args.out}: {done.messages} messages of {done.rows} rows, '
        f'{done.repeated} repeated rows dropped'
    )
    return 0
