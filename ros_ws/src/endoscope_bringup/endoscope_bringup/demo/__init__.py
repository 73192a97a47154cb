"""The first paper's whole procedure on the simulated slave, recorded, with a report."""
