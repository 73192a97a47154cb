"""`cross_coupling`: the other bending joint moves this one."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'cross_coupling',
    Stage.JOINT,
    physics='The other bending joint moves this one: through the elastic section, or because its '
    "bending changes the length of this joint's wires.",
    equation='tau = moment_per_rad q_other + moment_per_rad2 q_other^2; stretch = r (m - q + '
    'wire_per_rad q_other)',
    source='Tsai, Robot Analysis, Wiley 1999, ch. 7 (tendon routing); Camarillo et al., IEEE '
    'Trans. Robot. 24(6), 2008 (elastic coupling)',
    parameters=(
        EffectParameter(
            'moment_per_rad', 'N m/rad', -0.05, 0.05, 0.005, off=0.0, starts=(0.003, 0.012, 0.0)
        ),
        EffectParameter('wire_per_rad', '-', -1.0, 1.0, 0.0, off=0.0, starts=(0.0, 0.05)),
        EffectParameter('moment_per_rad2', 'N m/rad2', -0.05, 0.05, 0.0),
    ),
)
ON = DEFINITION.flag
MOMENT = DEFINITION.first_parameter
WIRE = MOMENT + 1
SQUARE = MOMENT + 2


@compiled
def moment(parameters: Array, other_angle: float) -> float:
    """Moment in N m on the joint."""
    return (parameters[MOMENT] + parameters[SQUARE] * other_angle) * other_angle


@compiled
def wire_travel(parameters: Array, other_angle: float) -> float:
    """Angle, joint-equivalent, by which the other joint winds up this one's wires."""
    return parameters[WIRE] * other_angle
