"""`viscous_friction`: sheath friction proportional to the sliding speed."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'viscous_friction',
    Stage.TRANSMISSION,
    physics='The sheath brakes the wires in proportion to their sliding speed.',
    equation='T_proximal,distal = T exp(+-(phi z + load_factor v) / 2) '
    '+- coefficient v / (2 (1 + thinning |v|))',
    source='Olsson et al., Eur. J. Control 4(3), 1998, eq. 2 (film); Do et al., '
    'Mechatronics 24, 2014 (friction coefficient growing with speed); Cross, J. Colloid Sci. 20, '
    '1965, eq. 10 (film that thins with speed)',
    parameters=(
        EffectParameter('coefficient', 'N s/m', 0.0, 5000.0, 200.0, off=0.0, starts=(100.0,)),
        EffectParameter('load_factor', 's/m', 0.0, 500.0, 0.0, off=0.0, starts=(1.0,)),
        EffectParameter('thinning', 's/m', 0.0, 200.0, 0.0),
    ),
)
ON = DEFINITION.flag
COEFFICIENT = DEFINITION.first_parameter
LOAD_FACTOR = COEFFICIENT + 1
THINNING = COEFFICIENT + 2
LARGEST_EXPONENT = 3.0


@compiled
def exponent(parameters: Array, sliding_speed: float) -> float:
    """What is added to a wire's capstan exponent at a signed sliding speed in m/s."""
    added = parameters[LOAD_FACTOR] * sliding_speed
    return min(LARGEST_EXPONENT, max(-LARGEST_EXPONENT, added))


@compiled
def film(parameters: Array, sliding_speed: float) -> float:
    """Drag of the whole sheath on a wire per sliding speed, N s/m, at a speed in m/s."""
    return parameters[COEFFICIENT] / (1.0 + parameters[THINNING] * abs(sliding_speed))
