"""`wire_geometry`: the wires' travel is not proportional to the motor's angle."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import TRAVEL_OF, hook
from endoscope_core.physics.layout import PULLEY_RADIUS

EFFECT = Effect(
    'wire_geometry',
    Stage.TRANSMISSION,
    110,
    physics='One wire gives more than the other takes: both lengths have a part with the cosine of '
    'the angle.',
    equation='w(0) = +-r m - asymmetry (r m)^2 / r, r = pulley_radius; a section of n hinges whose '
    'wires pass them at a distance d and a height h takes +-2 n d sin(q / 2 n) and gives '
    '2 n h (1 - cos(q / 2 n))',
    source='Jones, Walker, IEEE Trans. Robot. 22(1), 2006 (n hinges, sine); kinematics of the rig '
    'of Nho et al., IEEE Robot. Autom. Lett. 2021: one wire gives 1.28 mm, the other takes 1.22 mm '
    'at 60 deg, asymmetry 0.04',
    parameters=(Parameter('asymmetry', '-', -2.0, 2.0, 0.05, off=0.0, starts=(-0.1, 0.1)),),
    traits=Traits(families=('travel_of_travel',)),
)
(ASYMMETRY,) = EFFECT.places


@hook(EFFECT, TRAVEL_OF)
@compiled
def taken(p: Array, x: Array, travel: float, wire: int) -> float:
    """By how much the pulley winds up a wire, m."""
    return travel - p[ASYMMETRY] * travel * travel / p[PULLEY_RADIUS]
