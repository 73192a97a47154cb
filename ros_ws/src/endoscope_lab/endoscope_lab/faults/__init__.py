"""Fault injection: faults that the layers of safety guard against, and how the graph responds."""
