"""Everything that can be wrong with a recording, under one base class."""

from endoscope_core.errors import EndoscopeError


class BagError(EndoscopeError):
    """Base of all errors of this package; the message is one line that names the thing."""


class BagNotFoundError(BagError, FileNotFoundError):
    """There is no file or folder of that name, or a file that the metadata lists is missing."""


class NotABagError(BagError):
    """The file or folder is something else."""


class EmptyBagError(BagError):
    """The recording holds no message."""


class CorruptBagError(BagError):
    """It ends in the middle, or bytes inside do not agree with their checksum or format."""


class BagExistsError(BagError, FileExistsError):
    """The place that a recording should go to is taken; nothing is ever overwritten."""


class BagWriteError(BagError):
    """The disk does not take the recording; what was recorded until then is kept."""


class MissingTopicError(BagError):
    """The recording lacks a topic that is needed."""


class MalformedMessageError(BagError):
    """A message does not decode as its type says."""


class UnknownTypeError(BagError):
    """A message type whose definition is nowhere to be found."""
