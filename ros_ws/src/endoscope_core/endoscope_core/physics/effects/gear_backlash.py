"""`gear_backlash`: play between encoder and pulley."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage
from endoscope_core.physics.effects.laws import play
from endoscope_core.physics.hooks import PULLEY_ANGLE, hook
from endoscope_core.physics.layout import SLOTS

EFFECT = Effect(
    'gear_backlash',
    Stage.ACTUATOR,
    50,
    physics='Play between encoder and pulley; the measured shaft is before it.',
    equation='pulley = mean of play(shaft, gap_rad (1 + k flank_spread)), k = -1, 0, 1: moves only '
    'once the shaft has crossed the gap, gradually where worn flanks carry one after the other',
    source='Tao, Kokotovic, Adaptive Control of Systems with Actuator and Sensor '
    'Nonlinearities, Wiley 1996, ch. 2; plays in parallel: Krasnoselskii, Pokrovskii, Systems with '
    'Hysteresis, Springer 1989',
    parameters=(
        Parameter('gap_rad', 'rad', 0.0, 1.0, 0.1, off=0.0, starts=(0.05, 0.15), comparable=True),
        Parameter('flank_spread', '-', 0.0, 0.9, 0.0, starts=(0.15,)),
    ),
)
GAP, SPREAD = EFFECT.places
FLANKS = SLOTS.state_block(3)
"""Angle of each flank, rad: the middle of the gap is at the angle at which wires are tightened."""


@hook(EFFECT, PULLEY_ANGLE)
@compiled
def behind_play(p: Array, x: Array, shaft: float) -> float:
    """Pulley's angle in rad once the shaft has moved to `shaft`; keeps the memory."""
    half_gap = 0.5 * p[GAP]
    total = 0.0
    for k in range(3):
        share = 1.0 + (k - 1) * p[SPREAD]
        x[FLANKS + k] = play(x[FLANKS + k], shaft, half_gap * share)
        total += x[FLANKS + k] - shaft
    return shaft + total / 3.0
