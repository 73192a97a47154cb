"""Proof with sealed truths: injects effects into rigs, explains their recordings, compares."""

OWN, OTHER = 'own', 'other'
SIMULATORS = (OWN, OTHER)
"""Simulator of the injected laws: the kernel, or another one that shares no code with it."""
SLAVE = 'slave'
"""The simulated slave, running in the graph, as the rig."""
