"""Compensation laws: feed-forward and feedback."""

from endoscope_core.control.adaptive_backlash import AdaptiveBacklashController, TrackerMeasurement
from endoscope_core.control.adaptive_backlash_law import AdaptiveBacklashSettings
from endoscope_core.control.bouc_wen_feedforward import (
    MODES,
    BoucWenFeedforward,
    FeedforwardLaw,
    FeedforwardSettings,
)

__all__ = [
    'MODES',
    'AdaptiveBacklashController',
    'AdaptiveBacklashSettings',
    'BoucWenFeedforward',
    'FeedforwardLaw',
    'FeedforwardSettings',
    'TrackerMeasurement',
]
