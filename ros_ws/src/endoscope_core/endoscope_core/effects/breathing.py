"""`breathing`: a periodic disturbance with a frequency of its own."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'breathing',
    Stage.JOINT,
    physics='A periodic moment with a frequency of its own: the patient breathes.',
    equation='tau = moment_nm (sin a + second_harmonic cos 2a), '
    'a = 2 pi frequency_hz t + phase_rad',
    source='Lujan et al., Med. Phys. 26(5), 1999 (second_harmonic 0 for n = 1, +-0.25 for n = 2)',
    parameters=(
        EffectParameter('moment_nm', 'N m', 0.0, 0.1, 0.004, off=0.0, starts=(0.003,)),
        EffectParameter(
            'frequency_hz',
            'Hz',
            0.02,
            5.0,
            0.25,
            # No further apart than what 40 s resolve; people breathe 6 to 36 times a minute.
            starts=tuple(0.1 + 0.02 * k for k in range(26)),
            comparable=True,
        ),
        EffectParameter('phase_rad', 'rad', -7.0, 7.0, 0.0, starts=(0.0, 1.6), phase=True),
        EffectParameter('second_harmonic', '-', -0.5, 0.5, 0.0),
    ),
)
ON = DEFINITION.flag
MOMENT = DEFINITION.first_parameter
FREQUENCY = MOMENT + 1
PHASE = MOMENT + 2
SECOND = MOMENT + 3


@compiled
def moment(parameters: Array, time: float) -> float:
    """Moment in N m on the joint at `time`."""
    along = 2.0 * math.pi * parameters[FREQUENCY] * time + parameters[PHASE]
    value = math.sin(along)
    if parameters[SECOND] != 0.0:
        value += parameters[SECOND] * math.cos(2.0 * along)
    return parameters[MOMENT] * value
