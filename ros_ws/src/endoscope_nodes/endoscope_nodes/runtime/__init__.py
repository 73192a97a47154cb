"""What every process of nodes has: its ticker, parameters, streams, diagnostics, and who spins."""
