"""`endoscope completion`: prints what makes a shell complete commands and options."""

import argparse

SHELLS = ('bash', 'zsh', 'tcsh')

_EPILOG = """\
bash, now:     eval "$(endoscope completion bash)"
bash, always:  endoscope completion bash > ~/.local/share/bash-completion/completions/endoscope
zsh:           endoscope completion zsh > _endoscope, in a folder of $fpath
"""


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `completion`."""
    parser = subparsers.add_parser(
        'completion',
        help='print a script by which a shell completes commands and options',
        description='Prints a script by which a shell completes commands and options.',
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('shell', choices=SHELLS, help='which shell')


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    import shtab

    from endoscope_bringup.cli import build_parser

    print(shtab.complete(build_parser(), args.shell))
    return 0
