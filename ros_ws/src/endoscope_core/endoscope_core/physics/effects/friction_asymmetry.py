"""`friction_asymmetry`: sheath friction differs between pull and release."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage
from endoscope_core.physics.hooks import DIRECTION, hook

EFFECT = Effect(
    'friction_asymmetry',
    Stage.TRANSMISSION,
    80,
    physics='A wire is braked more when it is pulled than when it is released, or less.',
    equation='phi (1 + asymmetry) where the wire slides towards the motor, phi (1 - asymmetry) '
    'where it slides towards the joint',
    source='Direction-dependent Coulomb friction: Armstrong-Helouvry, Control of Machines with '
    'Friction, 1991, ch. 2',
    parameters=(Parameter('asymmetry', '-', -0.95, 0.95, 0.3, off=0.0, starts=(-0.2, 0.2)),),
)
(ASYMMETRY,) = EFFECT.places


@hook(EFFECT, DIRECTION)
@compiled
def factors(p: Array, x: Array) -> tuple[float, float]:
    """Factors on the exponent where a wire slides towards the motor, and towards the joint."""
    return 1.0 + p[ASYMMETRY], 1.0 - p[ASYMMETRY]
