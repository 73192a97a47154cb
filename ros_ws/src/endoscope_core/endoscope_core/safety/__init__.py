"""What stands between a command and motion: states, gates, guards and clutch."""

from endoscope_core.safety.clutch_follower import ClutchFollower
from endoscope_core.safety.command_gate import CommandGate, CommandLimits, Refusal
from endoscope_core.safety.motion_shaper import MotionLimits, MotionShaper
from endoscope_core.safety.operating_state import (
    Answer,
    OperatingState,
    OperatingStateMachine,
    StateCommand,
)
from endoscope_core.safety.tension_guard import TensionGuard

__all__ = [
    'Answer',
    'ClutchFollower',
    'CommandGate',
    'CommandLimits',
    'MotionLimits',
    'MotionShaper',
    'OperatingState',
    'OperatingStateMachine',
    'Refusal',
    'StateCommand',
    'TensionGuard',
]
