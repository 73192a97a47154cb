"""`breathing`: a periodic disturbance with a frequency of its own."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import LOAD, hook

EFFECT = Effect(
    'breathing',
    Stage.JOINT,
    70,
    physics='A periodic moment with a frequency of its own: the patient breathes.',
    equation='tau = moment_nm (sin a + second_harmonic cos 2a), '
    'a = 2 pi frequency_hz t + phase_rad',
    source='Lujan et al., Med. Phys. 26(5), 1999 (second_harmonic 0 for n = 1, +-0.25 for n = 2)',
    parameters=(
        Parameter('moment_nm', 'N m', 0.0, 0.1, 0.0006, off=0.0, starts=(0.0004,)),
        Parameter(
            'frequency_hz',
            'Hz',
            0.02,
            5.0,
            0.25,
            # No further apart than what 40 s resolve; people breathe 6 to 36 times a minute.
            starts=tuple(0.1 + 0.02 * k for k in range(26)),
            comparable=True,
        ),
        Parameter('phase_rad', 'rad', -7.0, 7.0, 0.0, starts=(0.0, 1.6), phase=True),
        Parameter('second_harmonic', '-', -0.5, 0.5, 0.0),
    ),
    traits=Traits(depends_on_time=True, families=('load_periodic',)),
)
MOMENT, FREQUENCY, PHASE, SECOND = EFFECT.places


@hook(EFFECT, LOAD)
@compiled
def moment(
    p: Array, x: Array, angle: float, step: float, other: float, time: float, tick: float
) -> tuple[float, float]:
    """Moment in N m on the joint at `time`; it does not depend on the step."""
    along = 2.0 * math.pi * p[FREQUENCY] * time + p[PHASE]
    value = math.sin(along)
    if p[SECOND] != 0.0:
        value += p[SECOND] * math.cos(2.0 * along)
    return p[MOMENT] * value, 0.0
