"""Rigs with something concealed, what is said of them, and whether it is right."""
