"""Where numba keeps the compiled physics.

Numba's cache looks at the one file that holds a function, not at the functions that it calls in
other files: after a change of one effect it would go on running the old physics. The cache folder
is therefore named after a hash of all sources of this package. Modules with compiled functions take
`njit` from here, so that only they, not every start of the program, import numba.
"""

import hashlib
import os
from pathlib import Path

import numba
from numba import njit

__all__ = ['njit', 'source_hash', 'use_cache_of_these_sources']


def source_hash(package: Path) -> str:
    """Hash of every Python file below `package`, as 16 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob('*.py')):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def use_cache_of_these_sources() -> None:
    """Point numba at a cache folder of exactly these sources, unless NUMBA_CACHE_DIR is set."""
    if 'NUMBA_CACHE_DIR' in os.environ:
        return
    base = Path(os.environ.get('XDG_CACHE_HOME', Path.home() / '.cache'))
    folder = base / 'endoscope' / 'numba' / source_hash(Path(__file__).parent)
    # Numba sets the names of its configuration at run time, out of the type checker's sight.
    numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]


use_cache_of_these_sources()
