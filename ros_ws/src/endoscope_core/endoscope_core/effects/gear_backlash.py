"""`gear_backlash`: play between encoder and pulley."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects import play
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import JOINT_RADIUS, PULLEY_RADIUS, SLOTS

DEFINITION = define(
    'gear_backlash',
    Stage.ACTUATOR,
    physics='Play between encoder and pulley; the measured shaft is before it.',
    equation='pulley = play(shaft, gap_rad): moves only once the shaft has crossed the gap',
    source='Tao, Kokotovic, Adaptive Control of Systems with Actuator and Sensor '
    'Nonlinearities, Wiley 1996, ch. 2',
    parameters=(
        EffectParameter(
            'gap_rad', 'rad', 0.0, 1.0, 0.1, off=0.0, starts=(0.05, 0.15), comparable=True
        ),
    ),
)
ON = DEFINITION.flag
GAP = DEFINITION.first_parameter
OUTPUT = SLOTS.angle_state()


@compiled
def behind_play(state: Array, parameters: Array, motor: float) -> float:
    """Pulley angle, joint-equivalent, once the motor has moved to `motor`; keeps the memory."""
    half_gap = 0.5 * parameters[GAP] * parameters[PULLEY_RADIUS] / parameters[JOINT_RADIUS]
    state[OUTPUT] = play.follow(state[OUTPUT], motor, half_gap)
    return state[OUTPUT]
