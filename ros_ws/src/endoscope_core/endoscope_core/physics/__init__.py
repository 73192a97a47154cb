"""The simulated slave: friction along the whole sheath, and the effects that can be added to it."""
