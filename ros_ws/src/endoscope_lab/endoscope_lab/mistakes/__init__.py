"""Recordings with injected mistakes of units, signs and signals, and correct ones."""
