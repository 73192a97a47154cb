"""A slave moved by hand: dead-man, lease and handles of keys, pages and sticks, without devices."""

from endoscope_core.teleop.dead_man import DeadMan
from endoscope_core.teleop.envelope import Envelope
from endoscope_core.teleop.frames import (
    InputFrame,
    MalformedFrameError,
    Source,
    TelemetryFrame,
    decode_input,
    decode_telemetry,
    encode_input,
    encode_telemetry,
)
from endoscope_core.teleop.joy_mapping import JoyMapping, JoyMappingError
from endoscope_core.teleop.keyboard_handle import (
    SPEEDS,
    STOPS_AFTER_S,
    KeyboardHandle,
    Request,
    Turn,
)
from endoscope_core.teleop.lease import Claim, Lease
from endoscope_core.teleop.operator import Conditions, DeadManState, OperatorDeadMan, Reason
from endoscope_core.teleop.pad import PadHandle
from endoscope_core.teleop.terminal_keys import KeyEvent, KeyEventKind, TerminalKeys

__all__ = [
    'SPEEDS',
    'STOPS_AFTER_S',
    'Claim',
    'Conditions',
    'DeadMan',
    'DeadManState',
    'Envelope',
    'InputFrame',
    'JoyMapping',
    'JoyMappingError',
    'KeyEvent',
    'KeyEventKind',
    'KeyboardHandle',
    'Lease',
    'MalformedFrameError',
    'OperatorDeadMan',
    'PadHandle',
    'Reason',
    'Request',
    'Source',
    'TelemetryFrame',
    'TerminalKeys',
    'Turn',
    'decode_input',
    'decode_telemetry',
    'encode_input',
    'encode_telemetry',
]
