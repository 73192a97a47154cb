"""Locates, names and models the physics that a simulation has left out."""
