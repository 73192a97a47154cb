"""How much the nodes of a process say to the log."""

import os

from rclpy.logging import LoggingSeverity, set_logger_level

from endoscope_core.errors import EndoscopeError

LOG_LEVEL = 'ENDOSCOPE_LOG_LEVEL'
LEVELS = ('debug', 'info', 'warn', 'error', 'fatal')


class LogLevelError(EndoscopeError, ValueError):
    """A level that there is not; the message names those there are."""


def log_as_asked() -> None:
    """Take the level of the log from the environment, if it names one; call it before ROS starts.

    A `--log-level` among the ROS arguments of a program wins.

    Raises
    ------
    LogLevelError
        There is no such level.
    """
    asked = os.environ.get(LOG_LEVEL)
    if not asked:
        return
    if asked not in LEVELS:
        raise LogLevelError(f'{LOG_LEVEL} is {asked!r}; give one of {", ".join(LEVELS)}')
    set_logger_level('', LoggingSeverity[asked.upper()])
