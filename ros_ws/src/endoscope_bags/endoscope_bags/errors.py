"""Errors of recordings, under one base class."""

from endoscope_core.errors import EndoscopeError


class BagError(EndoscopeError):
    """A recording cannot be used; the message is one line that names the thing and why."""


class BagNotFoundError(BagError, FileNotFoundError):
    """There is no file or folder of that name, or a file that the metadata lists is missing."""


class CorruptBagError(BagError):
    """It ends in the middle, or bytes inside do not agree with their checksum or format."""


class BagExistsError(BagError, FileExistsError):
    """The target of a recording exists already; nothing is ever overwritten."""


class BagWriteError(BagError):
    """The recording cannot be written on; what was recorded until then is kept."""


class MalformedMessageError(BagError):
    """A message does not decode as its type says."""


class UnknownTypeError(BagError):
    """A message type whose definition is nowhere to be found."""
