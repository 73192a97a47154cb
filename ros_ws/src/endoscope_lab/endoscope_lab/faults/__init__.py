"""Breaks what the layers of safety guard against in the running graph, and measures the answer."""
