"""A slave moved by hand: when a dead-man lets it, and the angles that it runs to."""

from endoscope_core.teleop.dead_man import DeadMan
from endoscope_core.teleop.running_angles import RunningAngles

__all__ = ['DeadMan', 'RunningAngles']
