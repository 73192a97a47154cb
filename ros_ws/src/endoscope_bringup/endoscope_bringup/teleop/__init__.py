"""The slave moved by the keys of a terminal."""
