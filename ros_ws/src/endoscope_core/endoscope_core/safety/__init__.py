"""What stands between a command and motion: states, sessions, gates, guards and the shaper."""

from endoscope_core.safety.command_gate import CommandGate, CommandLimits, Refusal
from endoscope_core.safety.motion_session import MotionSession
from endoscope_core.safety.motion_shaper import MotionLimits, MotionShaper
from endoscope_core.safety.operating_state import (
    Answer,
    OperatingState,
    OperatingStateMachine,
    StateCommand,
)
from endoscope_core.safety.shaft_motion import ShaftMotion
from endoscope_core.safety.standing_still import StandingStill
from endoscope_core.safety.tension_guard import TensionGuard

__all__ = [
    'Answer',
    'CommandGate',
    'CommandLimits',
    'MotionLimits',
    'MotionSession',
    'MotionShaper',
    'OperatingState',
    'OperatingStateMachine',
    'Refusal',
    'ShaftMotion',
    'StandingStill',
    'StateCommand',
    'TensionGuard',
]
