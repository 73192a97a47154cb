"""A running graph as other programs see it: what it says, orders to it, and its parameters."""
