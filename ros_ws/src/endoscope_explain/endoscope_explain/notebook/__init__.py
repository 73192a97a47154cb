"""What a notebook or a script calls; the commands of the same names do the same."""

from endoscope_explain.notebook.calls import explain, read, simulate
from endoscope_explain.notebook.explained import Explained
from endoscope_explain.notebook.signals import Signal, Signals

__all__ = ['Explained', 'Signal', 'Signals', 'explain', 'read', 'simulate']
