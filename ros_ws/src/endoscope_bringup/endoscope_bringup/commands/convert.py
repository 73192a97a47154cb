"""`endoscope convert`: a text table of measurements to a bag."""

import argparse
from pathlib import Path

from endoscope_bringup.subcommands import add_json_option, print_json
from endoscope_core.errors import EndoscopeError, printable


class _MappingHelp(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from endoscope_bags.table_mapping import HELP

        print(f'{parser.format_help()}\n{HELP}', end='')
        parser.exit()


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `convert`."""
    parser = subparsers.add_parser(
        'convert',
        add_help=False,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        help='turn a text table of measurements into a bag',
        description='Writes the columns of TABLE, described by a mapping file, as topics of a '
        'bag. Without\na mapping it describes the table:\n\n'
        '    endoscope convert run.csv                              content of the table\n'
        '    endoscope convert run.csv --propose mapping.yaml       a mapping to fill in\n'
        '    endoscope convert run.csv --mapping mapping.yaml --out run',
    )
    # The keys of a mapping are read from where they are, and only when somebody asks.
    parser.add_argument(
        '-h', '--help', action=_MappingHelp, nargs=0, help='show this, with all keys of a mapping'
    )
    parser.add_argument('table', type=Path, metavar='TABLE', help='text, one row a sample')
    parser.add_argument(
        '--mapping',
        type=Path,
        metavar='M.yaml',
        help='which column is which topic, quantity, joint and unit',
    )
    parser.add_argument(
        '--propose', type=Path, metavar='M.yaml', help='write a mapping to fill in; new file'
    )
    parser.add_argument(
        '--out',
        type=Path,
        metavar='BAG',
        help='where to write: a bare file if it ends in .mcap, else a folder',
    )
    add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Convert and write, or describe the table; return 0."""
    from endoscope_bags.table_mapping import load_table_mapping
    from endoscope_bags.text_table import convert_table
    from endoscope_bringup.progress_line import ProgressLine

    if args.mapping is None:
        return _propose(args)
    if args.out is None or args.propose is not None:
        raise EndoscopeError('--mapping takes --out BAG, and no --propose')
    with ProgressLine() as bar:
        done = convert_table(args.table, load_table_mapping(args.mapping), args.out, bar.show)
    if args.json:
        print_json({'bag': args.out, **vars(done)})
        return 0
    print(f'{args.out}: {printable(str(done))}')
    return 0


def _propose(args: argparse.Namespace) -> int:
    from endoscope_bags.delimited_text import described_table, read_table
    from endoscope_core.atomic_output import write_text

    if args.out is not None:
        raise EndoscopeError(
            f'{args.out} is not written: say what the columns of {args.table} are with --mapping; '
            '--propose M.yaml writes one to begin with'
        )
    description = described_table(read_table(args.table))
    if args.propose is not None:
        write_text(args.propose, description.mapping(), overwrite=False)
    if args.json:
        print_json({**description.as_json(), 'mapping': description.mapping()})
        return 0
    print(description)
    if args.propose is None:
        print('Nothing is written: --propose M.yaml writes a mapping to fill in.')
    else:
        print(f'{args.propose}: fill it in, then give it with --mapping {args.propose} --out BAG')
    return 0
