"""What was recorded, as arrays: the input of every analysis."""

from endoscope_explain.recording.series import Recording, Series

__all__ = ['Recording', 'Series']
