"""`clock_skew`: the tracker's clock runs fast or slow against the rest.

It changes samples and not the rig: nothing of it is in the compiled physics.
"""

from collections.abc import Mapping

from endoscope_core.physics.effect import Effect, Parameter, Stage, Symptom, Traits
from endoscope_core.physics.hooks import on_samples
from endoscope_core.physics.sensing import RecordingFaults

STARTS = (-5e-4, 5e-4, -5e-3, 5e-3, -0.015, 0.015, -0.03, 0.03)
"""A skew is found from a start by which no angle of a motion of seconds over tens of seconds is off
by more than about a quarter of its period."""

EFFECT = Effect(
    'clock_skew',
    Stage.RECORDING,
    10,
    physics="The tracker's clock runs fast or slow against the other devices'.",
    equation='stamp = start + (1 + skew) (t - start)',
    source='Moon, Skelly, Towsley, IEEE INFOCOM 1999',
    parameters=(
        Parameter('skew', '-', -0.05, 0.05, 1e-3, off=0.0, starts=STARTS, comparable=True),
    ),
    traits=Traits(depends_on_time=True, of_device=True, symptom=Symptom.CLOCK_RATE),
)


@on_samples(EFFECT)
def skewed(values: Mapping[str, float], column: int) -> RecordingFaults:
    """The tracker's clock."""
    return RecordingFaults(skew=values['skew'])
