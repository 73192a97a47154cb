"""Figures by which hysteresis and its compensation are judged."""

from endoscope_core.metrics.backlash_size import NoLoopError, width_at_mid_height
from endoscope_core.metrics.tracking import tracking_rmse

__all__ = ['NoLoopError', 'tracking_rmse', 'width_at_mid_height']
