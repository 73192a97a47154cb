"""What a notebook or a script calls; the commands of the same names do the same."""

from endoscope_core.errors import EndoscopeError
from endoscope_explain.notebook.calls import Explained, explain, simulate
from endoscope_explain.notebook.signals import RecordedSignal, Signals, from_arrays, read

__all__ = [
    'EndoscopeError',
    'Explained',
    'RecordedSignal',
    'Signals',
    'explain',
    'from_arrays',
    'read',
    'simulate',
]
