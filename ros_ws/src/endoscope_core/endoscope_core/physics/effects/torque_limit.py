"""`torque_limit`: the servo slows down under load and stalls at a torque."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage
from endoscope_core.physics.hooks import TORQUE, hook

EFFECT = Effect(
    'torque_limit',
    Stage.ACTUATOR,
    40,
    physics='The servo stalls where the wires load it with its largest torque.',
    equation="|tau| <= limit_nm - droop max(0, m' sgn tau), tau = pulley_radius (Ta(0) - Tb(0)); "
    'the motor yields there',
    source='Torque source with saturation: Siciliano et al., Robotics, 2009, sec. 5.2; speed-'
    'torque line of a DC motor: Krishnan, Electric Motor Drives, 2001, ch. 2',
    parameters=(
        Parameter(
            'limit_nm',
            'N m',
            1e-3,
            10.0,
            0.018,
            off=10.0,
            # Friction makes the torque nearly constant in motion: a little more never stalls.
            starts=tuple(0.006 * 1.05**k for k in range(42)),
            scale=0.002,
        ),
        Parameter('droop', 'N m s/rad', 0.0, 0.01, 0.0, starts=(5e-4,)),
    ),
)
LIMIT, DROOP = EFFECT.places


@hook(EFFECT, TORQUE)
@compiled
def bearable(p: Array, x: Array, speed: float) -> float:
    """Largest torque in N m at a speed in rad/s; all of it where the load drives the motor."""
    return max(0.0, p[LIMIT] - p[DROOP] * max(0.0, speed))
