"""The one base of every error that a user, not a programmer, has to act on."""


class EndoscopeError(Exception):
    """An input, a file or a request that cannot be used as it is.

    The message is one line that names the thing and says what to do. The command line prints it
    on stderr and exits 2; anything that is not an `EndoscopeError` is a defect and keeps its
    traceback. Derive from a built-in as well where callers expect one:
    ``class X(EndoscopeError, ValueError)``.
    """
