"""`viscous_friction`: sheath friction proportional to the sliding speed."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import EXPONENT, FILM_DRAG, hook
from endoscope_core.physics.layout import CAPSTAN_EXPONENT

EFFECT = Effect(
    'viscous_friction',
    Stage.TRANSMISSION,
    40,
    physics='The sheath brakes the wires in proportion to their sliding speed.',
    equation='phi(v) = phi + load_factor |v|; T at the motor and at the joint '
    '+- coefficient v / (2 (1 + thinning |v|))',
    source='Olsson et al., Eur. J. Control 4(3), 1998, eq. 2 (film); Do et al., '
    'Mechatronics 24, 2014 (friction coefficient growing with speed); Cross, J. Colloid Sci. 20, '
    '1965, eq. 10 (film that thins with speed)',
    parameters=(
        Parameter('coefficient', 'N s/m', 0.0, 5000.0, 200.0, off=0.0, starts=(100.0,)),
        Parameter('load_factor', 's/m', 0.0, 500.0, 0.0, off=0.0, starts=(0.0, 100.0)),
        Parameter('thinning', 's/m', 0.0, 1000.0, 0.0),
    ),
    traits=Traits(families=('exponent_of_speed', 'film_drag_of_speed')),
)
COEFFICIENT, LOAD_FACTOR, THINNING = EFFECT.places
LARGEST_EXPONENT = 3.0
"""That speed may add."""
LEAST_EXPONENT = 1e-6
"""Of a sheath to whose friction speed adds any."""


@hook(EFFECT, EXPONENT)
@compiled
def factor(p: Array, x: Array, speed: float, time: float, tick: float) -> float:
    """Factor on the capstan exponent at a sliding speed in m/s."""
    added = min(LARGEST_EXPONENT, p[LOAD_FACTOR] * speed)
    return 1.0 + added / max(p[CAPSTAN_EXPONENT], LEAST_EXPONENT)


@hook(EFFECT, FILM_DRAG)
@compiled
def film(p: Array, x: Array, speed: float) -> float:
    """Drag of the whole sheath on a wire per sliding speed, N s/m, at a speed in m/s."""
    return p[COEFFICIENT] / (1.0 + p[THINNING] * speed)
