"""Turns modules of subcommands, those of other packages too, into argparse subparsers."""

import argparse
import importlib
import itertools
import json
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any, NoReturn

from endoscope_core.errors import nearest, printable

GROUP = 'endoscope.commands'
"""An entry point of it names a module of the same form as those of `endoscope_bringup.commands`."""
COMES_WITH = {
    'bench': 'endoscope_lab',
    'console': 'endoscope_console',
    'dataset': 'endoscope_lab',
    'fit': 'endoscope_lab',
    'prove': 'endoscope_lab',
    'train': 'endoscope_lab',
}
"""Packages of this workspace that may be left out, by the command that is missing then."""
_SECTION = re.compile(rf'^\[{re.escape(GROUP)}\]\n((?:[^\[\n].*\n?|\n)*)', re.MULTILINE)
_ENTRY = re.compile(r'^(\S+) *= *([\w.]+) *$', re.MULTILINE)


class OneLineParser(argparse.ArgumentParser):
    """An `ArgumentParser` whose errors are one line, with the nearest known word."""

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """Parse, and refuse what is unknown where it is known what else there is."""
        words = sys.argv[1:] if args is None else list(args)
        # Before a missing argument is reported, which is often the misspelt one.
        for word in itertools.takewhile(lambda word: word != '--', words):
            if not word.startswith('-') and self._subparsers is not None:
                break  # a subcommand: the rest is for its parser
            if word.startswith('--'):
                self._refuse_unknown(word.partition('=')[0])
        parsed, extras = super().parse_known_args(words, namespace)
        for word in extras:
            self._refuse_unknown(word)
        return parsed, extras

    def _refuse_unknown(self, word: str) -> None:
        if not word.startswith('-') or word in self._option_string_actions:
            return
        if not self._get_option_tuples(word):
            options = [option for option in self._option_string_actions if option[:2] == '--']
            self.error(f'unknown option {word}: {nearest(word, options)}')

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            choices = [str(choice) for choice in action.choices]
            raise argparse.ArgumentError(
                action, f'unknown {value!r}: {nearest(str(value), choices)}'
            )

    def error(self, message: str) -> NoReturn:
        """Exit 2 with `message` and where to find the usage, in one line on stderr."""
        one_line = printable(' '.join(message.split()))
        self.exit(2, f'{self.prog}: {one_line} (see {self.prog} --help)\n')


def add_subcommands(parser: argparse.ArgumentParser, modules: Iterable[str]) -> None:
    """Add one subparser for each module, in this order; `run_command` of the arguments runs it."""
    subparsers = parser.add_subparsers(dest='command', metavar='COMMAND', required=True)
    for name in modules:
        module = importlib.import_module(name)
        known = set(subparsers.choices)
        module.add_parser(subparsers)
        for added in set(subparsers.choices) - known:
            subparsers.choices[added].set_defaults(run_command=module.run)


def within[T: (int, float)](low: T, high: T, kind: type[T]) -> Callable[[str], T]:
    """Return a type for argparse: a number of a kind from `low` to `high`, both allowed."""

    def number(text: str) -> T:
        value = kind(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f'{text} is not between {low:g} and {high:g}')
        return value

    return number


COUNT = within(1, 1_000_000, int)
SECONDS = within(1e-3, 3600.0, float)
"""A time to wait."""


def add_options(parser: argparse.ArgumentParser, options: Any, *names: str) -> None:
    """Add an option for fields of a dataclass, all or some, as their metadata describe them."""
    for each in fields(options):
        how = {'default': each.default, **each.metadata}
        if ends := how.pop('ends', None):
            low, high = ends
            how['type'] = within(low, high, type(low))
        if each.default is False:
            how = {'help': how['help'], 'action': 'store_true'}
        if each.default == ():
            how['default'] = []
        if not names or each.name in names:
            parser.add_argument(f'--{each.name.replace("_", "-")}', **how)


def add_graph_options(
    parser: argparse.ArgumentParser, awaited: str = 'an answer', of: str = 'of the graph'
) -> None:
    """Add `--namespace` and `--timeout` to a command that asks a running graph."""
    parser.add_argument('--namespace', default='endoscope', help=f'{of} (default: %(default)s)')
    parser.add_argument(
        '--timeout',
        type=SECONDS,
        default=10.0,
        metavar='S',
        help=f'how long to wait for {awaited} (default: %(default)g)',
    )


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """Add `--json` to a command that prints a table; see `print_json`."""
    parser.add_argument(
        '--json', action='store_true', help='print JSON, with all digits, instead of a table'
    )


def print_json(content: object) -> None:
    """Print what a table shows as JSON, numbers as numbers, what is not finite as null."""
    print(json.dumps(_plain(content), indent=1, ensure_ascii=False, allow_nan=False))


def print_json_line(content: object) -> None:
    """Print the same in one line of ASCII, so that no foreign text controls the terminal."""
    print(json.dumps(_plain(content), allow_nan=False), flush=True)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(each) for each in value]
    if value is None or isinstance(value, bool | int):
        return value
    if hasattr(value, 'tolist'):  # an array
        return _plain(value.tolist())
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return str(value)


def seed(text: str) -> int:
    """Read a seed: a whole number below 2^32, as numpy's and torch's generators need it."""
    if not text.isdecimal() or int(text) >= 2**32:
        raise argparse.ArgumentTypeError(f'{text!r} is not a seed: give 0 to {2**32 - 1}')
    return int(text)


def commands_of_other_packages() -> dict[str, str]:
    """Find module names by command in `entry_points.txt` of all installed packages, sorted."""
    found: dict[str, str] = {}
    # `importlib.metadata` finds the same, but takes ten times as long, at every start.
    for folder in sys.path:
        try:
            with os.scandir(folder or os.curdir) as entries:
                installed = [
                    e.path for e in entries if e.name.endswith(('.dist-info', '.egg-info'))
                ]
        except OSError:  # an archive, or a folder that is not there
            continue
        for package in installed:
            for command, module in _entries(f'{package}/entry_points.txt'):
                # Of two packages with the same command the one that stands first in `sys.path`
                # counts.
                found.setdefault(command, module)
    return dict(sorted(found.items()))


def _entries(path: str) -> list[tuple[str, str]]:
    try:
        with open(path, encoding='utf-8') as file:  # noqa: PTH123 - of hundreds of files
            text = file.read()
    except OSError:  # a package without entry points
        return []
    section = _SECTION.search(text)
    return _ENTRY.findall(section[1]) if section else []
