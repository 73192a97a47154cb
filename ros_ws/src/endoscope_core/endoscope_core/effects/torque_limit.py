"""`torque_limit`: the servo slows down under load and stalls at a torque."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import JOINT_RADIUS, PULLEY_RADIUS

DEFINITION = define(
    'torque_limit',
    Stage.ACTUATOR,
    physics='The servo stalls where the wires load it with its largest torque.',
    equation='|tau| + droop |shaft speed| <= limit_nm, tau = pulley_radius (Ta_proximal - '
    'Tb_proximal); the motor yields there',
    source='Torque source with saturation: Siciliano et al., Robotics, 2009, sec. 5.2; speed-'
    'torque line of a DC motor: Krishnan, Electric Motor Drives, 2001, ch. 2',
    parameters=(
        EffectParameter(
            'limit_nm',
            'N m',
            1e-3,
            10.0,
            0.055,
            off=10.0,
            # Friction makes the torque nearly constant in motion: a little more never stalls.
            starts=tuple(0.02 * 1.04**k for k in range(42)),
            scale=0.005,
        ),
        EffectParameter('droop', 'N m s/rad', 0.0, 0.01, 0.0, starts=(5e-4,)),
    ),
)
ON = DEFINITION.flag
LIMIT = DEFINITION.first_parameter
DROOP = LIMIT + 1


@compiled
def yielding(
    parameters: Array, step: float, loads: tuple[float, float, float, float], dt: float
) -> float:
    """Step of the motor in rad, joint-equivalent, cut where its load reaches the limit.

    `loads` are the tensions of both wires in N before the step, and the slope of their torque in
    N m/rad if the motor turns up, and down; the step takes `dt` s.
    """
    positive, negative, slope_up, slope_down = loads
    torque = parameters[PULLEY_RADIUS] * (positive - negative)
    shaft_per_step = parameters[JOINT_RADIUS] / parameters[PULLEY_RADIUS] / dt
    slope = parameters[DROOP] * shaft_per_step + 1e-9
    above = parameters[LIMIT] - torque
    below = -parameters[LIMIT] - torque
    highest = above / (slope + (slope_up if above > 0.0 else slope_down))
    lowest = below / (slope + (slope_down if below < 0.0 else slope_up))
    return min(highest, max(lowest, step))
