"""How the generator's physics is compiled, and where numba keeps it."""

import inspect
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from endoscope_core.compiled_cache import source_hash


def cache_folder() -> Path:
    """Cache folder of exactly the sources of the generator and of the plant.

    Numba notices a change of the file that holds a compiled function, not of those it calls in
    other files. What the plant's package compiles after the generator was imported is kept here,
    too, and would be run for ever if the folder did not change with the plant's sources.
    """
    base = Path(os.environ.get('XDG_CACHE_HOME', Path.home() / '.cache'))
    plant = source_hash(Path(inspect.getfile(source_hash)).parent)
    return base / 'endoscope' / 'numba' / f'generator-{source_hash(Path(__file__).parent)}-{plant}'


if 'NUMBA_CACHE_DIR' not in os.environ:
    vars(numba.config)['CACHE_DIR'] = str(cache_folder())

_OPTIONS: dict[str, Any] = {'cache': True, 'error_model': 'numpy', '_nrt': False}
compiled: Callable[[Callable[..., Any]], Callable[..., Any]] = numba.njit(**_OPTIONS)
"""Decorator for physics on arrays that the caller made: without reference counts of their views."""
