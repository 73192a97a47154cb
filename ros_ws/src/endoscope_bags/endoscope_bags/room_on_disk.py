"""Asks the file system for room before it is needed, so that a full disk loses nothing."""

import errno
import os

from endoscope_bags.errors import BagFullError, BagWriteError

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_NOT_OFFERED = {errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL}


def require_room(descriptor: int, name: str, n_bytes: int) -> None:
    """Raise BagFullError unless a file, positioned at its end, can grow by `n_bytes`."""
    end = os.lseek(descriptor, 0, os.SEEK_CUR)
    try:
        # Given back at once: this alone asks the disk, the quota and the limit of file sizes
        # together.
        os.posix_fallocate(descriptor, end, n_bytes)
    except OSError as error:
        if error.errno in _NOT_OFFERED:
            return
        raise write_error(error, name) from error
    finally:
        os.ftruncate(descriptor, end)


def write_error(error: OSError, name: str) -> BagWriteError:
    """Return what to raise for an error of the file `name`; a full disk has its own class."""
    kind = BagFullError if error.errno in _FULL else BagWriteError
    return kind(f'{name}: {error.strerror}; recording ended there')
