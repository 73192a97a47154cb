"""The nodes, a module each."""
