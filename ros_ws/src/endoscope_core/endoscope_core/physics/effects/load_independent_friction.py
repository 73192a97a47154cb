"""`load_independent_friction`: a part of the sheath's friction does not grow with the tension."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import FRICTION_FLOOR, hook
from endoscope_core.physics.layout import CAPSTAN_EXPONENT

EFFECT = Effect(
    'load_independent_friction',
    Stage.TRANSMISSION,
    100,
    physics="A part of the sheath's friction does not grow with the tension: seals, lubricant, a "
    "slack wire's own pressure.",
    equation='dT/dphi = -+(T + force_n / Phi) where the wire slides: force_n over the whole sheath',
    source='Derjaguin, Z. Phys. 88, 1934 (mu (N + N0)); around a capstan: Jung, Pan, Kang, Mech. '
    'Mach. Theory 43(6), 2008 (friction not proportional to the normal force)',
    parameters=(Parameter('force_n', 'N', 0.0, 20.0, 0.5, off=0.0, starts=(0.3, 1.5)),),
    traits=Traits(families=('exponent_of_tension',)),
)
(FORCE,) = EFFECT.places
LEAST_EXPONENT = 1e-3


@hook(EFFECT, FRICTION_FLOOR)
@compiled
def floor(p: Array, x: Array) -> float:
    """Tension in N that would cause this friction."""
    return p[FORCE] / max(p[CAPSTAN_EXPONENT], LEAST_EXPONENT)
