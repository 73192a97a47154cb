"""The seed of a random generator as an argument of the command line."""

import argparse


def seed(text: str) -> int:
    """Read a seed: a whole number below 2^32, as numpy's and torch's generators need it."""
    if not text.isdecimal() or int(text) >= 2**32:
        raise argparse.ArgumentTypeError(f'{text!r} is no seed: give 0 to {2**32 - 1}')
    return int(text)
