"""Pose of the tip from an electromagnetic tracker."""

from endoscope_devices.em_tracker.aurora_tracker import (
    AuroraTracker,
    TrackerDevice,
    TrackerReading,
    TrackerSettings,
)
from endoscope_devices.em_tracker.registration import (
    RegistrationWindow,
    load_registration,
    save_registration,
)

__all__ = [
    'AuroraTracker',
    'RegistrationWindow',
    'TrackerDevice',
    'TrackerReading',
    'TrackerSettings',
    'load_registration',
    'save_registration',
]
