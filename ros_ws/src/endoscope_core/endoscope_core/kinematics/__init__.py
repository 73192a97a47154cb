"""From bending angles to the pose of the tip, and back."""

from endoscope_core.kinematics.constant_curvature import bending_from_orientation, tip_pose

__all__ = ['bending_from_orientation', 'tip_pose']
