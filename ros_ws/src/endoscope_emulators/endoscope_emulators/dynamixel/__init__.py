"""Servos on a pseudo-terminal that keep to the maker's manual; see doc/devices.md."""
