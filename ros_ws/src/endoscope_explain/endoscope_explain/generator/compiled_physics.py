"""How the generator's physics is compiled, and where numba keeps it."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from endoscope_core.compiled_cache import source_hash


def _use_cache_of_the_generator() -> None:
    """Point numba at the generator's own cache folder, unless NUMBA_CACHE_DIR is set.

    Numba notices a change of the file that holds a compiled function, not of those it calls in
    other files; hence a folder named after a hash of all of them.
    """
    if 'NUMBA_CACHE_DIR' in os.environ:
        return
    base = Path(os.environ.get('XDG_CACHE_HOME', Path.home() / '.cache'))
    folder = base / 'endoscope' / 'numba' / f'generator-{source_hash(Path(__file__).parent)}'
    vars(numba.config)['CACHE_DIR'] = str(folder)


_use_cache_of_the_generator()

_OPTIONS: dict[str, Any] = {'cache': True, 'error_model': 'numpy', '_nrt': False}
compiled: Callable[[Callable[..., Any]], Callable[..., Any]] = numba.njit(**_OPTIONS)
"""Decorator for physics on arrays that the caller made: without reference counts of their views."""
