"""`external_load`: a constant moment from some time on."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects import onset
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'external_load',
    Stage.JOINT,
    physics='A constant moment acts on the joint from some time on.',
    equation='tau = moment_nm after time_s, risen within duration_s around it: evenly, or if '
    'smooth along a half cosine',
    source='Step disturbance: De Luca, Mattone, IEEE ICRA 2005',
    parameters=(
        EffectParameter(
            'moment_nm', 'N m', -0.1, 0.1, 0.005, off=0.0, starts=(0.003,), comparable=True
        ),
        EffectParameter(
            'time_s',
            's',
            0.0,
            3600.0,
            15.0,
            starts=onset.STARTS,
            comparable=True,
        ),
        EffectParameter('duration_s', 's', 0.0, 5.0, 0.0, starts=(0.05,)),
        EffectParameter('smooth', '-', 0.0, 1.0, 0.0, counted=True),
    ),
)
ON = DEFINITION.flag
MOMENT = DEFINITION.first_parameter
TIME = MOMENT + 1
DURATION = MOMENT + 2
SMOOTH = MOMENT + 3


@compiled
def mean_moment(parameters: Array, time: float, tick: float) -> float:
    """Mean moment in N m over the tick around `time`."""
    begun = onset.share_after(
        parameters[TIME], parameters[DURATION], parameters[SMOOTH], time, tick
    )
    return parameters[MOMENT] * begun
