"""The one base of every error that a user, not a programmer, has to act on."""

import difflib
from collections.abc import Iterable

_LONGEST = 2000


class EndoscopeError(Exception):
    """An input, a file or a request that cannot be used as it is.

    The message is one line that names the thing and says what to do. The command line prints it
    on stderr and exits 2; anything that is not an `EndoscopeError` is a defect, and is called one
    by `endoscope_core.exit_status`. Names that come out of files or off the network go into it as
    they are: wherever it is shown, it is `printable` and of 2000 characters at most. Derive from a
    built-in as well where callers expect one: ``class X(EndoscopeError, ValueError)``.
    """

    def __str__(self) -> str:
        # An OSError, which some derive from as well, would take its arguments for errno and text.
        text = ' '.join(Exception.__str__(self).splitlines())
        return printable(text if len(text) <= _LONGEST else f'{text[:_LONGEST]} ...')


class FileError(EndoscopeError, ValueError):
    """A file that cannot be used; the message names the file, the key and what to do."""


class InputError(EndoscopeError, ValueError):
    """A name, number or recording that cannot be used; the message says which are."""


class OutputError(EndoscopeError, OSError):
    """Nothing can be written where an output should go to, or the place is taken."""


class RigStoppedError(EndoscopeError):
    """The rig stopped by itself; the message says why."""


class NotPlayedError(EndoscopeError):
    """A person did not want a motion, or ended it."""


def nearest(name: str, valid: Iterable[str]) -> str:
    """A hint that names the valid name nearest to a wrong one, and else all of them."""
    valid = list(valid)
    close = difflib.get_close_matches(name, valid, n=1, cutoff=0.5)
    return f'did you mean {close[0]}?' if close else 'valid are ' + ', '.join(valid)


def printable(text: str) -> str:
    r"""Text with everything that steers a terminal shown as python writes it, such as ``\x1b``.

    Control characters could clear a screen or set its title, line breaks forge lines of a log,
    and marks of direction turn names around (Boucher, Anderson, USENIX Security 2023).
    """
    if text.isprintable():
        return text
    return ''.join(c if c.isprintable() else c.encode('unicode_escape').decode() for c in text)
