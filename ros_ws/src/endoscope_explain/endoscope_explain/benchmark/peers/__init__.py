"""Other ways to name what is missing, from the residual alone: regression on a library of terms."""

from endoscope_explain.benchmark.peers.naming import name_with_peers

__all__ = ['name_with_peers']
