"""`gear_friction`: friction of gear and motor, which only the motor's effort shows."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import EFFORT, hook

EFFECT = Effect(
    'gear_friction',
    Stage.ACTUATOR,
    70,
    physics="Friction of gear and motor: the motor's effort takes it on, and nothing behind the "
    'motor feels it.',
    equation="effort = tau + torque_nm tanh(m' / speed_rad_per_s) + viscous m'",
    source='Coulomb friction smoothed by tanh, with a viscous part: Andersson, Soderberg, '
    'Bjorklund, Tribology International 40(4), 2007',
    parameters=(
        Parameter('torque_nm', 'N m', 0.0, 5.0, 0.005, off=0.0, starts=(0.003, 0.02)),
        Parameter('speed_rad_per_s', 'rad/s', 1e-3, 5.0, 0.03),
        Parameter('viscous', 'N m s/rad', 0.0, 1.0, 0.0, off=0.0),
    ),
    traits=Traits(families=('effort_of_speed',)),
)
TORQUE, SPEED, VISCOUS = EFFECT.places


@hook(EFFECT, EFFORT)
@compiled
def braked(p: Array, x: Array, effort: float, speed: float) -> float:
    """Motor's torque in N m as the servo reads it."""
    return effort + p[TORQUE] * math.tanh(speed / p[SPEED]) + p[VISCOUS] * speed
