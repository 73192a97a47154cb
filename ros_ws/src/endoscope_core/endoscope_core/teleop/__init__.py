"""A slave moved by hand without a handle: the dead-man's rules, and the keys of a terminal."""

from endoscope_core.teleop.dead_man import DeadMan
from endoscope_core.teleop.keyboard_handle import (
    SPEEDS,
    STOPS_AFTER_S,
    KeyboardHandle,
    Request,
    Turn,
)
from endoscope_core.teleop.terminal_keys import KeyEvent, KeyEventKind, TerminalKeys

__all__ = [
    'SPEEDS',
    'STOPS_AFTER_S',
    'DeadMan',
    'KeyEvent',
    'KeyEventKind',
    'KeyboardHandle',
    'Request',
    'TerminalKeys',
    'Turn',
]
