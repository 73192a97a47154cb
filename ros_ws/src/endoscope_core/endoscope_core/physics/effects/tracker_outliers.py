"""`tracker_outliers`: isolated wrong samples of the tracker.

It changes samples and not the rig: nothing of it is in the compiled physics.
"""

from collections.abc import Mapping

from endoscope_core.physics.effect import Effect, Parameter, Stage, Symptom, Traits
from endoscope_core.physics.hooks import on_samples
from endoscope_core.physics.sensing import Outliers, RecordingFaults

EFFECT = Effect(
    'tracker_outliers',
    Stage.SENSING,
    50,
    physics='Isolated samples of the tracker are wrong.',
    equation='reading = q +- size_rad in a share `rate` of the samples, drawn by sample and seed',
    source='Tukey, A survey of sampling from contaminated distributions, 1960',
    parameters=(
        Parameter('rate', '-', 0.0, 0.5, 0.01, off=0.0),
        Parameter('size_rad', 'rad', 0.0, 3.0, 0.2, off=0.0),
    ),
    traits=Traits(audited=True, symptom=Symptom.WRONG_SAMPLES),
)


@on_samples(EFFECT)
def wrong(values: Mapping[str, float], column: int) -> RecordingFaults:
    """The joint's wrong samples."""
    return RecordingFaults(outliers=(Outliers(column, values['rate'], values['size_rad']),))
