"""What a compensator decides: the law that is in force, and which commands go out by it."""

from endoscope_core.compensation.command_stream import (
    Command,
    CommandStream,
    CommandTopics,
    Measured,
    Source,
)
from endoscope_core.compensation.law_in_force import LawInForce, Selection

__all__ = [
    'Command',
    'CommandStream',
    'CommandTopics',
    'LawInForce',
    'Measured',
    'Selection',
    'Source',
]
