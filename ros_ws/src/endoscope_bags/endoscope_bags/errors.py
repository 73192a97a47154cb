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


class TruncatedBagError(BagError):
    """The recording ends in the middle: it was cut, or its recorder was killed."""


class CorruptBagError(BagError):
    """Bytes inside the recording do not agree with their checksum or format."""


class UnsupportedBagError(BagError):
    """A format that other programs write and this one does not read."""


class BagExistsError(BagError, FileExistsError):
    """The place that a recording should go to is taken; nothing is ever overwritten."""


class BagWriteError(BagError):
    """The disk does not take the recording; what was recorded until then is kept."""


class BagFullError(BagWriteError):
    """The disk or the quota is full."""


class MissingTopicError(BagError):
    """The recording lacks a topic that is needed."""


class AmbiguousTopicError(BagError):
    """More than one topic of the recording answers to the name."""


class TopicTypeError(BagError):
    """A topic carries another message type than the one that is needed."""


class MissingJointError(BagError):
    """A topic lacks a joint, or a quantity of its joints, that is needed."""


class MalformedMessageError(BagError):
    """A message does not decode as its type says."""


class NonFiniteError(BagError):
    """A message holds NaN or infinity where a number is needed."""


class UnknownTypeError(BagError):
    """A message type whose definition is nowhere to be found."""
