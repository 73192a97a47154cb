"""Training of the first paper's network, and calibration of its intervals and refusals."""
