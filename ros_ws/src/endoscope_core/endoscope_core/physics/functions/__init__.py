"""Places of the chain at which a smooth function of one state can be added to the nominal plant.

What belongs to no effect of the catalogue is such a function: a formula or values in plant.yaml, or
what a fit has found. The functions share the effects' flags and parameter blocks.
"""

from endoscope_core.errors import nearest
from endoscope_core.physics.effect import UnknownEffectError, in_order_of_chain
from endoscope_core.physics.functions import places
from endoscope_core.physics.functions.place import Place

__all__ = ['FUNCTIONS', 'describe_place', 'places']

FUNCTIONS: dict[str, Place] = in_order_of_chain(Place)
"""All places by their ids, in the order of the chain."""


def describe_place(place_id: str) -> Place:
    """The place of that id.

    Raises
    ------
    UnknownEffectError
        If there is none; the message names the nearest.
    """
    if place_id not in FUNCTIONS:
        raise UnknownEffectError(f'unknown place {place_id}: {nearest(place_id, FUNCTIONS)}')
    return FUNCTIONS[place_id]
