"""`gear_backlash`: play between encoder and pulley."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects import play
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import JOINT_RADIUS, PULLEY_RADIUS, SLOTS

DEFINITION = define(
    'gear_backlash',
    Stage.ACTUATOR,
    physics='Play between encoder and pulley; the measured shaft is before it.',
    equation='pulley = mean of play(shaft, gap_rad (1 + k flank_spread)), k = -1, 0, 1: moves only '
    'once the shaft has crossed the gap, gradually where worn flanks carry one after the other',
    source='Tao, Kokotovic, Adaptive Control of Systems with Actuator and Sensor '
    'Nonlinearities, Wiley 1996, ch. 2; plays in parallel: Krasnoselskii, Pokrovskii, Systems with '
    'Hysteresis, Springer 1989',
    parameters=(
        EffectParameter(
            'gap_rad', 'rad', 0.0, 1.0, 0.1, off=0.0, starts=(0.05, 0.15), comparable=True
        ),
        EffectParameter('flank_spread', '-', 0.0, 0.9, 0.0, starts=(0.15,)),
    ),
)
ON = DEFINITION.flag
GAP = DEFINITION.first_parameter
SPREAD = GAP + 1
OUTPUT = SLOTS.angle_state()
NARROW = SLOTS.angle_state()
WIDE = SLOTS.angle_state()


@compiled
def behind_play(state: Array, parameters: Array, motor: float) -> float:
    """Pulley angle, joint-equivalent, once the motor has moved to `motor`; keeps the memory."""
    half_gap = 0.5 * parameters[GAP] * parameters[PULLEY_RADIUS] / parameters[JOINT_RADIUS]
    spread = parameters[SPREAD] * half_gap
    state[OUTPUT] = play.follow(state[OUTPUT], motor, half_gap)
    state[NARROW] = play.follow(state[NARROW], motor, half_gap - spread)
    state[WIDE] = play.follow(state[WIDE], motor, half_gap + spread)
    return (state[OUTPUT] + state[NARROW] + state[WIDE]) / 3.0
