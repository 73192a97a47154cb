"""`joint_backlash`: play between wire end and tip."""

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import play
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import TIP

DEFINITION = define(
    'joint_backlash',
    Stage.JOINT,
    physics='Play between the end of the wires and the tip.',
    equation='tip = play(q, gap_rad); with loaded_tip, stiffness and friction act on the tip, the '
    'wire end, slowed by wire_end_damping, is free within the gap and, beyond it, '
    'flank_compliance M ahead of the tip',
    source='Nordin, Gutman, Automatica 38(10), 2002: hysteresis and dead-zone models of backlash',
    parameters=(
        EffectParameter(
            'gap_rad', 'rad', 0.0, 1.5, 0.12, off=0.0, starts=(0.08, 0.2), comparable=True
        ),
        EffectParameter('loaded_tip', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
        EffectParameter('flank_compliance', 'rad/(N m)', 0.0, 20.0, 0.0, off=0.0),
        EffectParameter('wire_end_damping', 'N m s/rad', 0.0, 1e-3, 0.0, off=0.0),
    ),
)
ON = DEFINITION.flag
GAP = DEFINITION.first_parameter
LOADED_TIP = GAP + 1
FLANK_COMPLIANCE = GAP + 2
WIRE_END_DAMPING = GAP + 3


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
    """Wire end's offset from the tip, the moment that reaches the tip, and how firmly they touch.

    Parameters
    ----------
    parameters : array (parameters,)
    offset : float
        Of the wire end from the tip before this step, rad.
    pull : float
        Moment of the wires on their end, N m.
    stiffness : float
        By how much the pull falls as the wire end gives way, N m/rad.

    Returns
    -------
    (float, float, float)
        The last is the share of `stiffness` that the tip feels: 0 within the gap, 1 where rigid
        flanks touch.
    """
    half_gap = 0.5 * parameters[GAP]
    stiffness = max(stiffness, 1e-9)
    free = offset + pull / stiffness
    edge = min(half_gap, max(-half_gap, free))
    if free == edge:
        return free, 0.0, 0.0
    firmness = 1.0 / (1.0 + parameters[FLANK_COMPLIANCE] * stiffness)
    moment = (free - edge) * stiffness * firmness
    return edge + parameters[FLANK_COMPLIANCE] * moment, moment, firmness
