"""Change detection: whether a rig still matches its plant while it moves, and if not, where."""

from endoscope_core.monitoring.rig_change import Part
from endoscope_core.monitoring.rig_watch import DetectedChange, RigWatch

__all__ = ['DetectedChange', 'Part', 'RigWatch']
