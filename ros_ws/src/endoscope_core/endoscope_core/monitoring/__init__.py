"""Watches whether a rig that works is still the one that its plant describes."""

from endoscope_core.monitoring.rig_change import Part
from endoscope_core.monitoring.rig_watch import Alarm, RigWatch

__all__ = ['Alarm', 'Part', 'RigWatch']
