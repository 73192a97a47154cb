"""Output files and folders that appear whole or not at all."""

import errno
import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from endoscope_core.errors import OutputError

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
_PARTIAL = re.compile(r'(?<![\w.-])\.partial-[0-9a-f]{8}-')


@contextmanager
def atomic_file(path: str | Path, *, overwrite: bool = True) -> Iterator[Path]:
    """Write a file under a temporary name; it takes its own name when the block ends well.

    Yields a hidden sibling of `path` with the same suffix, not yet there; missing parent folders
    are made. OutputError where `path` is a folder, or exists and `overwrite` is false.
    """
    target = Path(path)
    if target.is_dir():
        raise OutputError(f'{target} is a folder: name a file')
    if target.exists() and not overwrite:
        raise OutputError(f'{target} exists already: remove it or name another file')
    partial = _partial_sibling(target)
    try:
        with _named(target):
            yield partial
            _flush_to_disk(partial)
        partial.replace(target)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def atomic_directory(path: str | Path) -> Iterator[Path]:
    """Fill a folder under a temporary name; it takes its own name when the block ends well.

    Yields an empty hidden sibling of `path`; missing parent folders are made. OutputError
    where `path` is a file or a folder with something in it.
    """
    target = Path(path).resolve()
    require_free_directory(target)
    partial = _partial_sibling(target)
    partial.mkdir()
    try:
        with _named(target):
            yield partial
        partial.replace(target)
    finally:
        shutil.rmtree(partial, ignore_errors=True)


def with_final_names(text: str) -> str:
    """A path, or a line of text, with outputs under the names that they will have when done."""
    return _PARTIAL.sub('', text)


def require_free_directory(path: str | Path) -> None:
    """Check before long work: OutputError if no folder can be written."""
    target = Path(path).absolute()
    if target.is_dir():
        if any(target.iterdir()):
            raise OutputError(f'{target} is not empty: remove it or name another folder')
    elif target.exists():
        raise OutputError(f'{target} is a file: name a folder')
    require_place(target)


def require_place(path: str | Path) -> None:
    """Check before long work: OutputError if the folder around `path` takes nothing."""
    target = Path(path).absolute()
    place = next(parent for parent in target.parents if parent.exists())
    if not place.is_dir():
        raise OutputError(f'{target} cannot be created: {place} is a file')
    try:
        with tempfile.TemporaryDirectory(prefix='.partial-', dir=place):
            pass
    except OSError as error:
        raise OutputError(
            f'{target} cannot be created: {place} takes nothing ({error.strerror})'
        ) from error


def make_parent(path: Path) -> None:
    """Make the folder that an output goes to; git ignores a new one that is called `bags`."""
    folder = path.parent
    if folder.name == 'bags' and not folder.exists():
        folder.mkdir(parents=True)
        (folder / '.gitignore').write_text('*\n', encoding='utf-8')
    folder.mkdir(parents=True, exist_ok=True)


def write_text(path: str | Path, text: str, *, overwrite: bool = True) -> None:
    """Write `text` as UTF-8 to `path`, whole or not at all; errors as in `atomic_file`."""
    with atomic_file(path, overwrite=overwrite) as partial:
        partial.write_text(text, encoding='utf-8')


@contextmanager
def _named(target: Path) -> Iterator[None]:
    """Name the output in errors of writing, such as that of a full disk, that name no file."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno in _NO_ROOM:
            error.filename = str(target)
        raise


def _partial_sibling(target: Path) -> Path:
    make_parent(target)
    # The suffix stays last because several writers choose their format by it.
    return target.with_name(f'.partial-{secrets.token_hex(4)}-{target.name}')


def _flush_to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
