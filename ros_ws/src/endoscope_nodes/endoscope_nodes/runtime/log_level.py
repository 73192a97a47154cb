"""How much the nodes of a process say to the log."""

import os

from rclpy.logging import LoggingSeverity, set_logger_level

from endoscope_core.choices import LOG_LEVEL_VARIABLE, LOG_LEVELS
from endoscope_core.errors import EndoscopeError


class LogLevelError(EndoscopeError, ValueError):
    """A level that there is not; the message names those there are."""


def log_as_asked() -> None:
    """Set the log level of the environment, if any; before ROS starts, whose `--log-level` wins."""
    asked = os.environ.get(LOG_LEVEL_VARIABLE)
    if not asked:
        return
    if asked not in LOG_LEVELS:
        raise LogLevelError(
            f'{LOG_LEVEL_VARIABLE} is {asked!r}; give one of {", ".join(LOG_LEVELS)}'
        )
    set_logger_level('', LoggingSeverity[asked.upper()])
