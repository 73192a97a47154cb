"""The seed of a random generator as an argument of the command line."""

import argparse


def seed(text: str) -> int:
    """Read a seed.

    Raises
    ------
    argparse.ArgumentTypeError
        It is no whole number of at least 0, as numpy's and torch's generators need it.
    """
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f'{text!r} is no seed: give a whole number from 0 on')
    return int(text)
