"""`joint_backlash`: play between wire end and tip."""

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import play
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import TIP

DEFINITION = define(
    'joint_backlash',
    Stage.JOINT,
    physics='Play between the end of the wires and the tip.',
    equation='tip = play(q, gap_rad); with loaded_tip, stiffness and friction act on the tip and '
    'the wire end is free within the gap',
    source='Nordin, Gutman, Automatica 38(10), 2002: hysteresis and dead-zone models of backlash',
    parameters=(
        EffectParameter(
            'gap_rad', 'rad', 0.0, 1.5, 0.12, off=0.0, starts=(0.08, 0.2), comparable=True
        ),
        EffectParameter('loaded_tip', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
    ),
)
ON = DEFINITION.flag
GAP = DEFINITION.first_parameter
LOADED_TIP = GAP + 1


@compiled
def tip_is_loaded(parameters: Array, on: Flags) -> bool:
    """Whether the effect is on and the joint's own load acts beyond the play."""
    return on[ON] and parameters[LOADED_TIP] > 0.5 and parameters[GAP] > 0.0


@compiled
def tip(state: Array, parameters: Array, joint: float) -> float:
    """Tip angle once the joint has moved to `joint`, where the wire end carries the load."""
    return play.follow(state[TIP], joint, 0.5 * parameters[GAP])


@compiled
def through_gap(
    parameters: Array, offset: float, pull: float, stiffness: float
) -> tuple[float, float, float]:
    """Wire end's offset from the tip, the moment that reaches the tip, and whether they touch.

    Parameters
    ----------
    parameters : array (parameters,)
    offset : float
        Of the wire end from the tip before this step, rad.
    pull : float
        Moment of the wires on their end, N m.
    stiffness : float
        By how much the pull falls as the wire end gives way, N m/rad.
    """
    half_gap = 0.5 * parameters[GAP]
    free = offset + pull / max(stiffness, 1e-9)
    offset = min(half_gap, max(-half_gap, free))
    return offset, (free - offset) * stiffness, 0.0 if free == offset else 1.0
