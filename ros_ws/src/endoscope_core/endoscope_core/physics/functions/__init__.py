"""Smooth functions of one state that can be added to the nominal plant at places of its chain.

What belongs to no effect of the catalogue is such a function: a formula or values in plant.yaml, or
what a fit has found. The functions share the effects' flags and parameter blocks.
"""

from endoscope_core.physics.functions.places import FUNCTIONS, describe_place

__all__ = ['FUNCTIONS', 'describe_place']
