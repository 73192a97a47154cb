"""`torque_limit`: the servo stalls at a torque."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import PULLEY_RADIUS

DEFINITION = define(
    'torque_limit',
    Stage.ACTUATOR,
    physics='The servo stalls where the wires load it with its largest torque.',
    equation='|pulley_radius (Ta_proximal - Tb_proximal)| <= limit_nm; the motor yields there',
    source='Ideal torque source with saturation: Siciliano et al., Robotics, 2009, sec. 5.2',
    parameters=(
        EffectParameter(
            'limit_nm', 'N m', 1e-3, 10.0, 0.055, off=10.0, starts=(0.03, 0.045, 0.055)
        ),
    ),
)
ON = DEFINITION.flag
LIMIT = DEFINITION.first_parameter


@compiled
def yielding(parameters: Array, step: float, loads: tuple[float, float, float, float]) -> float:
    """Step of the motor in rad, joint-equivalent, cut where its load reaches the limit.

    `loads` are the tensions of both wires in N before the step, and the slope of their torque in
    N m/rad if the motor turns up, and down.
    """
    positive, negative, slope_up, slope_down = loads
    torque = parameters[PULLEY_RADIUS] * (positive - negative)
    above = parameters[LIMIT] - torque
    below = -parameters[LIMIT] - torque
    highest = above / max(slope_up if above > 0.0 else slope_down, 1e-9)
    lowest = below / max(slope_down if below < 0.0 else slope_up, 1e-9)
    return min(highest, max(lowest, step))
