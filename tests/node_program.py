"""The program of a node, or of several, for a process of its own."""


def code_of(name: str) -> str:
    """What its executable runs, wherever that is installed."""
    return f'import sys; from endoscope_nodes.program import {name}; sys.exit({name}())'
