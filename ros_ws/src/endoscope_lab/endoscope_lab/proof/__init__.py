"""Conceals something in rigs, explains their recordings, and opens what was sealed."""

OWN, OTHER = 'own', 'other'
SIMULATORS = (OWN, OTHER)
"""Whose laws are concealed: those of the kernel, or those of a simulator that shares nothing."""
SLAVE = 'slave'
"""The form of a rig that is the simulated slave, running in the graph."""
