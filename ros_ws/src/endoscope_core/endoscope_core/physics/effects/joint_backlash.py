"""`joint_backlash`: play between the wires' end and the tip."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage
from endoscope_core.physics.effects.laws import play
from endoscope_core.physics.hooks import TIP_ANGLE, hook
from endoscope_core.physics.layout import TIP

EFFECT = Effect(
    'joint_backlash',
    Stage.JOINT,
    10,
    physics='Play between the end of the wires and the tip.',
    equation='tip = play(q, gap_rad)',
    source='Nordin, Gutman, Automatica 38(10), 2002: hysteresis model of backlash',
    parameters=(
        Parameter('gap_rad', 'rad', 0.0, 1.5, 0.12, off=0.0, starts=(0.08, 0.2), comparable=True),
    ),
)
(GAP,) = EFFECT.places


@hook(EFFECT, TIP_ANGLE)
@compiled
def behind_play(p: Array, x: Array, joint: float) -> float:
    """Tip's angle in rad once the joint has moved to `joint`, where the wires' ends are."""
    return play(x[TIP], joint, 0.5 * p[GAP])
