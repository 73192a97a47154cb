"""`cross_coupling`: the other bending joint moves this one."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import END_LENGTH, LOAD, hook
from endoscope_core.physics.layout import JOINT_RADIUS

EFFECT = Effect(
    'cross_coupling',
    Stage.JOINT,
    60,
    physics='The other bending joint moves this one, through the elastic section or its wires.',
    equation='tau = moment_per_rad q_other + moment_per_rad2 q_other^2; w(Phi) = +-joint_radius '
    '(q - wire_per_rad q_other)',
    source='Tsai, Robot Analysis, Wiley 1999, ch. 7 (tendon routing); Camarillo et al., IEEE '
    'Trans. Robot. 24(6), 2008 (elastic coupling)',
    parameters=(
        Parameter(
            'moment_per_rad', 'N m/rad', -0.05, 0.05, 0.0015, off=0.0, starts=(1e-3, 4e-3, 0.0)
        ),
        Parameter('wire_per_rad', '-', -1.0, 1.0, 0.0, off=0.0, starts=(0.0, 0.1)),
        Parameter('moment_per_rad2', 'N m/rad2', -0.05, 0.05, 0.0),
    ),
    traits=Traits(families=('load_of_other_angle', 'end_way_of_other_angle')),
)
MOMENT, WIRE, SQUARE = EFFECT.places


@hook(EFFECT, LOAD)
@compiled
def moment(
    p: Array, x: Array, angle: float, step: float, other: float, time: float, tick: float
) -> tuple[float, float]:
    """Moment in N m on the joint; it does not depend on the step."""
    return (p[MOMENT] + p[SQUARE] * other) * other, 0.0


@hook(EFFECT, END_LENGTH)
@compiled
def wire_length(p: Array, x: Array, other: float) -> float:
    """What the other joint adds to the displacement of the positive wire at the joint, m."""
    return p[JOINT_RADIUS] * p[WIRE] * other
