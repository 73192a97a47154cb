"""The program `endoscope`: runs one subcommand and turns errors into one line."""

import argparse
import os
import shlex
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

from endoscope_bringup.commands import COMMANDS
from endoscope_bringup.subcommands import (
    COMES_WITH,
    OneLineParser,
    add_subcommands,
    commands_of_other_packages,
)
from endoscope_core.choices import LOG_LEVEL_VARIABLE, LOG_LEVELS
from endoscope_core.exit_status import exit_status

EXIT_TERMINATED = 143


class _Version(argparse.Action):
    """Prints the version of the package that is installed; looked up only where it is asked for."""

    def __init__(self, option_strings: Sequence[str], dest: str, **settings: Any) -> None:
        super().__init__(option_strings, dest, nargs=0, **settings)

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f'{parser.prog} {version("endoscope_bringup")}')
        parser.exit()


class _Program(OneLineParser):
    """Names the missing package of a command that is not installed."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        missing = action.dest == 'command' and value not in (action.choices or ())
        if missing and value in COMES_WITH:
            raise argparse.ArgumentError(
                None,
                f'{value} comes with the package {COMES_WITH[value]}, which is not installed here: '
                '`make -C ros_ws setup` installs it',
            )
        super()._check_value(action, value)


def build_parser() -> OneLineParser:
    """Return the parser of `endoscope` with all subcommands."""
    parser = _Program(
        prog='endoscope',
        description='Compensation of hysteresis in a flexible endoscope, on ROS 2 Jazzy.',
    )
    parser.add_argument('--version', action=_Version, help='print the version and exit')
    parser.add_argument(
        '--log-level',
        choices=LOG_LEVELS,
        help='lowest level that nodes and libraries of this command log (info)',
    )
    own = [f'endoscope_bringup.commands.{name}' for name in COMMANDS]
    add_subcommands(parser, [*own, *commands_of_other_packages().values()])
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run `endoscope`; the exit status as `exit_status` says, and 143 when terminated."""
    return exit_status('endoscope', lambda: _run(sys.argv[1:] if argv is None else argv))


def _run(argv: Sequence[str]) -> int:
    args = build_parser().parse_args(argv)
    args.command_line = shlex.join(['endoscope', *argv])
    if args.log_level is not None:
        _log_from(args.log_level)
    with _cleanup_on_sigterm():
        return int(args.run_command(args))


def _log_from(level: str) -> None:
    """Let this process, and the processes that it starts, log from this level on."""
    import logging

    # ROS takes it from the environment; python has the same levels by the same names.
    os.environ[LOG_LEVEL_VARIABLE] = level
    logging.basicConfig(level=getattr(logging, level.upper()))


@contextmanager
def _cleanup_on_sigterm() -> Iterator[None]:
    """Let SIGTERM unwind the stack, so that half-written outputs are removed."""

    def unwind(_signum: int, _frame: FrameType | None) -> None:
        raise SystemExit(EXIT_TERMINATED)

    previous = signal.signal(signal.SIGTERM, unwind)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


if __name__ == '__main__':
    sys.exit(main())
