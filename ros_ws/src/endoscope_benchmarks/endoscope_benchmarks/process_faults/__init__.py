"""Nodes of the running graph that die, stall or are spoken over, and what the slave makes of it."""
