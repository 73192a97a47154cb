"""What stands between a command and motion: states, sessions, gates, guards and the shaper."""

from endoscope_core.safety.adoption_code import AdoptionCode
from endoscope_core.safety.bending_range import BendingRange, keep_within, ranges_in_words
from endoscope_core.safety.command_gate import CommandGate, CommandLimits, Refusal
from endoscope_core.safety.contact_guard import ContactGuard, FeltForce, GuardState
from endoscope_core.safety.guards import StandingStill, TensionGuard
from endoscope_core.safety.motion_session import MotionSession
from endoscope_core.safety.motion_shaper import MotionLimits, MotionShaper
from endoscope_core.safety.operating_state import (
    Answer,
    OperatingState,
    OperatingStateMachine,
    StateCommand,
)
from endoscope_core.safety.shaft_motion import ShaftMotion

__all__ = [
    'AdoptionCode',
    'Answer',
    'BendingRange',
    'CommandGate',
    'CommandLimits',
    'ContactGuard',
    'FeltForce',
    'GuardState',
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
    'keep_within',
    'ranges_in_words',
]
