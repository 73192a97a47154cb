"""Turns a package of subcommand modules into argparse subparsers."""

import argparse
import importlib
import json
import math
from collections.abc import Iterable, Mapping
from typing import NoReturn


class OneLineParser(argparse.ArgumentParser):
    """An `ArgumentParser` whose errors are one line instead of a usage text and a line."""

    def error(self, message: str) -> NoReturn:
        """Exit 2 with `message` and where to find the usage, in one line on stderr."""
        one_line = ' '.join(message.split())
        self.exit(2, f'{self.prog}: {one_line} (see {self.prog} --help)\n')


def add_subcommands(parser: argparse.ArgumentParser, modules: Iterable[str], *, dest: str) -> None:
    """Add one subparser to `parser` for each module.

    Parameters
    ----------
    parser
        The parser whose first positional argument shall choose the subcommand.
    modules
        Their full names, for example ``'endoscope_bringup.commands.demo'``, in the order of the
        help.
    dest
        Attribute of the parsed arguments that will hold the choice; see `run_chosen`.
    """
    subparsers = parser.add_subparsers(dest=dest, metavar=dest.upper(), required=True)
    for name in modules:
        module = importlib.import_module(name)
        known = set(subparsers.choices)
        module.add_parser(subparsers)
        for added in set(subparsers.choices) - known:
            subparsers.choices[added].set_defaults(**{f'run_{dest}': module.run})


def run_chosen(args: argparse.Namespace, *, dest: str) -> int:
    """Run the module that `add_subcommands` with the same `dest` chose; return its exit status."""
    return int(getattr(args, f'run_{dest}')(args))


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """Add `--json` to a command that prints a table; see `print_json`."""
    parser.add_argument(
        '--json', action='store_true', help='print JSON, with all digits, instead of a table'
    )


def print_json(content: object) -> None:
    """Print what a table shows as one JSON document, numbers as numbers.

    Parameters
    ----------
    content
        Mappings, sequences, texts, numbers, truth values and None. What is not finite becomes null,
        which JSON has; paths become texts.
    """
    print(json.dumps(_plain(content), indent=1, ensure_ascii=False, allow_nan=False))


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(each) for each in value]
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return str(value)
