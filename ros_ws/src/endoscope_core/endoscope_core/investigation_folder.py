"""The folder of an investigation: one program's at a time, for as long as that lives."""

import errno
import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from endoscope_core.errors import InputError

LOG = 'log.json'
"""By which such a folder is known."""
PAGE = 'index.html'
"""What is known so far, to be read."""
_UNKNOWN = (errno.EBADF, errno.ENOLCK, errno.ENOTSUP)
"""A file system that does not show who holds a folder."""


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a folder, which is made, while the program lives; InputError while another does."""
    folder.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        if not _is_got(descriptor):
            raise InputError(
                f'another program investigates in {folder}: wait until it ends, or name another '
                'folder'
            )
        yield
    finally:
        os.close(descriptor)


def is_left_behind(bag: Path, here: Path) -> bool:
    """Whether a recording is of an investigation whose program is gone; `here` is held by ours."""
    folder = bag.parent
    if not (folder / LOG).is_file():
        return False
    if folder.samefile(here):
        return True
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        return _is_got(descriptor, unknown=False)
    finally:
        os.close(descriptor)


def _is_got(descriptor: int, *, unknown: bool = True) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno in _UNKNOWN:
            return unknown
        raise
    return True
