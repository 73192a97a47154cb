"""`clock_skew`: the tracker's clock runs fast or slow against the rest.

It changes samples and not the rig: nothing of it is in the compiled physics.
"""

from collections.abc import Mapping

from endoscope_core.physics.effect import Effect, Parameter, Stage, Symptom, Traits
from endoscope_core.physics.hooks import on_samples
from endoscope_core.physics.samples import RecordingFaults

EFFECT = Effect(
    'clock_skew',
    Stage.RECORDING,
    10,
    physics="The tracker's clock runs fast or slow against the other devices'.",
    equation='stamp = start + (1 + skew) (t - start)',
    source='Moon, Skelly, Towsley, IEEE INFOCOM 1999',
    parameters=(
        Parameter('skew', '-', -0.05, 0.05, 1e-3, off=0.0, starts=(-5e-4, 5e-4), comparable=True),
    ),
    traits=Traits(depends_on_time=True, of_device=True, symptom=Symptom.CLOCK_RATE),
)


@on_samples(EFFECT)
def skewed(values: Mapping[str, float], column: int) -> RecordingFaults:
    """The tracker's clock."""
    return RecordingFaults(skew=values['skew'])
