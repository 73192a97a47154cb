"""How the generator's physics is compiled, and where numba keeps it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from endoscope_core.compiled_cache import SOURCES, njit, use_cache_of

KEPT_BY = (Path(__file__).parent, SOURCES)
"""Packages whose sources name the cache folder."""
use_cache_of(*KEPT_BY)

_OPTIONS: dict[str, Any] = {'cache': True, 'error_model': 'numpy', '_nrt': False}
compiled: Callable[[Callable[..., Any]], Callable[..., Any]] = njit(**_OPTIONS)
"""Decorator for physics on arrays that the caller made: without reference counts of their views."""
