"""Identification of a rig from recordings in its tubes, and of a parameter set for each class."""
