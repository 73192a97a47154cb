"""Fitting a simulated joint, or several recordings of one, to what was recorded."""
