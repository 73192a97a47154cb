"""Recordings of the simulated slave through the live graph, explained with its own plant."""
