"""`joint_inertia`: the bending section's inertia is no longer negligible."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

# What rings is far from linear in the inertia: a fit finds it from within a factor of two only.
STARTS = (5e-6, 2e-5, 5e-5, 1e-4, 2e-4, 4e-4)
DEFINITION = define(
    'joint_inertia',
    Stage.JOINT,
    physics='The inertia of the bending section is not negligible: second-order ringing.',
    equation="inertia_kg_m2 q'' + c q' = r (Ta_distal - Tb_distal) - K q - tau_f zj",
    source='Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, 2006, sec. 7.3',
    parameters=(
        EffectParameter('inertia_kg_m2', 'kg m^2', 0.0, 2e-3, 5e-5, off=0.0, starts=STARTS),
    ),
)
ON = DEFINITION.flag
INERTIA = DEFINITION.first_parameter


@compiled
def speeds(
    parameters: Array,
    speed: float,
    settled_speed: float,
    resistance: float,
    duration: float,
) -> tuple[float, float]:
    """Mean speed over a step and speed at its end, with inertia.

    Parameters
    ----------
    parameters : array (parameters,)
    speed : float
        At the start, rad/s.
    settled_speed : float
        Speed without inertia, rad/s.
    resistance : float
        Moment by speed in N m s/rad over the step.
    duration : float
        In s.
    """
    if parameters[INERTIA] <= 0.0:
        return settled_speed, settled_speed
    ratio = duration * resistance / parameters[INERTIA]
    share = -math.expm1(-ratio)
    excess = speed - settled_speed
    return settled_speed + excess * share / ratio, settled_speed + excess * (1.0 - share)
