"""From bending angles to the pose of the tip, and back; from a tracker's frame to the base's."""

from endoscope_core.kinematics.constant_curvature import (
    TipVelocity,
    Vertebrae,
    bending_from_orientation,
    bending_rate,
    centre_line,
    tip_lever,
    tip_pose,
)
from endoscope_core.kinematics.robot_description import robot_description
from endoscope_core.kinematics.straight_registration import (
    RegistrationError,
    StraightRegistration,
    register_straight,
)

__all__ = [
    'RegistrationError',
    'StraightRegistration',
    'TipVelocity',
    'Vertebrae',
    'bending_from_orientation',
    'bending_rate',
    'centre_line',
    'register_straight',
    'robot_description',
    'tip_lever',
    'tip_pose',
]
