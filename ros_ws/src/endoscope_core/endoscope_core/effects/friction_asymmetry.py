"""`friction_asymmetry`: sheath friction differs between pull and release."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'friction_asymmetry',
    Stage.TRANSMISSION,
    physics='A wire is braked more when it is pulled than when it is released, or less.',
    equation='phi (1 + asymmetry) while pulled (z > 0), phi (1 - asymmetry) while released',
    source='Direction-dependent Coulomb friction: Armstrong-Helouvry, Control of Machines with '
    'Friction, 1991, ch. 2',
    parameters=(EffectParameter('asymmetry', '-', -0.95, 0.95, 0.3, off=0.0, starts=(-0.2, 0.2)),),
)
ON = DEFINITION.flag
ASYMMETRY = DEFINITION.first_parameter


@compiled
def friction_factor(parameters: Array, slide: float) -> float:
    """Factor on the capstan exponent of a wire in a pre-sliding state."""
    return 1.0 + parameters[ASYMMETRY] * (1.0 if slide > 0.0 else -1.0)
