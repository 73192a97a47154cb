"""What was recorded, as arrays: the input of every analysis."""

from endoscope_explain.recording.bag_source import (
    recording_from_bag,
    with_unrecorded,
)
from endoscope_explain.recording.series import Recording, Series

__all__ = ['Recording', 'Series', 'recording_from_bag', 'with_unrecorded']
