"""Hysteresis class of a tube from wire tensions (first paper, section 3.2)."""
