"""`friction_asymmetry`: sheath friction differs between pull and release."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'friction_asymmetry',
    Stage.TRANSMISSION,
    physics='A wire is braked more when it is pulled than when it is released, or less.',
    equation='phi (1 + asymmetry) while pulled (z > 0), phi (1 - asymmetry) while released; if '
    'gradual, phi (1 + asymmetry z)',
    source='Direction-dependent Coulomb friction: Armstrong-Helouvry, Control of Machines with '
    'Friction, 1991, ch. 2; that goes over with the pre-sliding state: Do, Tjahjowidodo, Lau, '
    'Phee, Mechatronics 24(8), 2014',
    parameters=(
        EffectParameter('asymmetry', '-', -0.95, 0.95, 0.3, off=0.0, starts=(-0.2, 0.2)),
        EffectParameter('gradual', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
    ),
)
ON = DEFINITION.flag
ASYMMETRY = DEFINITION.first_parameter
GRADUAL = ASYMMETRY + 1


@compiled
def friction_factor(parameters: Array, slide: float) -> float:
    """Factor on the capstan exponent of a wire in a pre-sliding state."""
    way = 1.0 if slide > 0.0 else -1.0
    return 1.0 + parameters[ASYMMETRY] * (slide if parameters[GRADUAL] > 0.5 else way)
