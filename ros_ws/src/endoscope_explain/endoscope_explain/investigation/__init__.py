"""Motions that a rig is asked to make, one after the other, until it is explained."""
