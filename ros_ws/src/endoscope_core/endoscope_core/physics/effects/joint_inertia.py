"""`joint_inertia`: the bending section's inertia is no longer negligible."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage
from endoscope_core.physics.hooks import LOAD, hook
from endoscope_core.physics.layout import JOINT_STEP

# What rings is far from linear in the inertia: a fit finds it from within a factor of two only.
STARTS = (5e-7, 1.5e-6, 4e-6, 1e-5, 3e-5, 8e-5)
EFFECT = Effect(
    'joint_inertia',
    Stage.JOINT,
    50,
    physics='The inertia of the bending section is not negligible: second-order ringing.',
    equation="inertia_kg_m2 q'' + c q' = r (Ta(Phi) - Tb(Phi)) - K (q - q0) - tau_f z",
    source='Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, 2006, sec. 7.3',
    parameters=(Parameter('inertia_kg_m2', 'kg m^2', 0.0, 1e-3, 1e-5, off=0.0, starts=STARTS),),
)
(INERTIA,) = EFFECT.places


@hook(EFFECT, LOAD)
@compiled
def moment(
    p: Array, x: Array, angle: float, step: float, other: float, time: float, tick: float
) -> tuple[float, float]:
    """Moment in N m that the change of speed takes, and minus its derivative by the step."""
    by_step = p[INERTIA] / (tick * tick)
    return -by_step * (step - x[JOINT_STEP]), by_step
