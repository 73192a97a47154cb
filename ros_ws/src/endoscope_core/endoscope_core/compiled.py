"""How the inner loops of this package are compiled, and where numba keeps them.

Numba's cache looks at the one file that holds a function, not at the functions that it calls in
other files: after a change of one effect it would go on running the old physics. The cache folder
is therefore named after a hash of all sources of this package. Modules with compiled functions take
`njit` from here, so that only they, not every start of the program, import numba.
"""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ['SOURCES', 'cache_folder', 'njit', 'source_hash', 'use_cache_of']

SOURCES = Path(__file__).parent
"""This package, the plant's."""
Array = NDArray[np.float64]
Flags = NDArray[Any]
"""Truth values of what is on; bytes where a plant has functions as well as effects."""

_OPTIONS: dict[str, Any] = {'cache': True, 'error_model': 'numpy', 'nogil': True, '_nrt': False}
compiled: Callable[[Callable[..., Any]], Callable[..., Any]] = njit(**_OPTIONS)
"""Decorator for physics on arrays that the caller made.

Compiled functions here allocate nothing, so numba need not count references to their arrays; the
counting, at every call of every effect, would take four times as long as the physics. Division by
zero gives an infinity instead of an exception.
"""


def source_hash(package: Path) -> str:
    """Hash of every Python file below `package`, as 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob('*.py')):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder(*packages: Path) -> Path:
    """Cache folder of exactly the sources of these packages."""
    base = Path(os.environ.get('XDG_CACHE_HOME', Path.home() / '.cache'))
    return base / 'endoscope' / 'numba' / '-'.join(source_hash(package) for package in packages)


def use_cache_of(*packages: Path) -> None:
    """Keep what is compiled from now on by the sources of `packages`, unless NUMBA_CACHE_DIR says.

    Numba takes the folder when a function is decorated: whoever names another one names `SOURCES`
    with his own, as modules of this package may be imported after it.
    """
    if 'NUMBA_CACHE_DIR' not in os.environ:
        # Numba sets the names of its configuration at run time, out of the type checker's sight.
        numba.config.CACHE_DIR = str(cache_folder(*packages))  # type: ignore[attr-defined]


use_cache_of(SOURCES)
