"""Training of the first paper's network, and how far it is to be trusted."""
