"""How a program ends: its exit status, one line on stderr, and the close of what it holds."""

import contextlib
import itertools
import os
import sys
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Self

from endoscope_core.choices import LOG_LEVEL_VARIABLE
from endoscope_core.errors import EndoscopeError, printable

UNUSABLE = 2
INTERRUPTED = 130
_READER_IS_GONE = 1
_LONGEST_REASON = 300


def exit_status(program: str, run: Callable[[], int]) -> int:
    """Run a program and turn whatever ends it into its exit status; lines begin with its name.

    The status is what `run` returned; 2 on input that cannot be used, on a file or device that the
    system refuses, without memory and on a defect, each with one line that names the thing; 1 where
    the reader of stdout has gone; 130 when interrupted. The line of a defect says that it is one
    and where; at the log level debug the traceback stands above it.
    """
    _have_standard_streams()
    try:
        try:
            return run()
        finally:
            _flush_stdout()
    except KeyboardInterrupt:
        print(f'{program}: interrupted', file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        return _READER_IS_GONE
    except Exception as error:  # noqa: BLE001 - the one place where nothing can catch it later
        if _wants_traceback():
            traceback.print_exception(error)
        line = printable(' '.join(_reason(error).split()))
        with contextlib.suppress(BrokenPipeError):
            print(f'{program}: {line}', file=sys.stderr)
        return UNUSABLE


def _reason(error: Exception) -> str:
    if isinstance(error, EndoscopeError):
        return str(error)
    text = str(error)[:_LONGEST_REASON]
    if isinstance(error, OSError):
        if error.filename is not None:
            return f'{error.filename}: {error.strerror}'
        return f'{error.strerror or text or type(error).__name__} ({_last_own_frame(error)})'
    if isinstance(error, MemoryError):
        return f'not enough memory{": " if text else ""}{text}'
    last = _last_own_frame(error)
    return (
        f'a defect of this program in {last}: {type(error).__name__}: {text}; please report it; '
        '--log-level debug shows the traceback'
    )


def _last_own_frame(error: Exception) -> str:
    """Where the code of this project was last, as FILE:LINE."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if '/endoscope_' in frame.filename] or list(frames)
    return f'{Path(own[-1].filename).name}:{own[-1].lineno}'


def _wants_traceback() -> bool:
    words = sys.argv[1:]
    return (
        os.environ.get(LOG_LEVEL_VARIABLE) == 'debug'
        or '--log-level=debug' in words
        or ('--log-level', 'debug') in itertools.pairwise(words)
    )


def _have_standard_streams() -> None:
    """Open what was closed, so that no other file gets its number, and nobody finds None."""
    for name, mode in (('stdin', 'r'), ('stdout', 'w'), ('stderr', 'w')):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: PTH123, SIM115 - until the end


def _flush_stdout() -> None:
    try:
        sys.stdout.flush()
    except OSError as error:
        # Python's own flush at exit must not complain a second time.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            raise
        raise OSError(error.errno, error.strerror, 'stdout') from error


class ClosedOnExit(ABC):
    """Is closed at the end of its `with` block, whether that ends in an exception or not."""

    @abstractmethod
    def close(self) -> None:
        """Let go of everything it holds."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
