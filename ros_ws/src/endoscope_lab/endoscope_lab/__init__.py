"""Measures the figures of the documentation: `endoscope bench`. No other package imports it."""
