"""`recording_gap`: samples of a topic are missing.

It changes samples and not the rig: nothing of it is in the compiled physics.
"""

from collections.abc import Mapping

from endoscope_core.physics.effect import Effect, Parameter, Stage, Symptom, Traits
from endoscope_core.physics.hooks import on_samples
from endoscope_core.physics.sensing import TOPICS, Gap, RecordingFaults

EFFECT = Effect(
    'recording_gap',
    Stage.RECORDING,
    20,
    physics='The samples of one topic are missing for a while.',
    equation='topic 0 motor, 1 wires, 2 tracker: no sample in time_s <= t < time_s + duration_s',
    source='Little, Rubin, Statistical Analysis with Missing Data, 3rd ed. 2019, ch. 1',
    parameters=(
        Parameter('time_s', 's', 0.0, 3600.0, 5.0, comparable=True),
        Parameter('duration_s', 's', 0.0, 600.0, 0.5, off=0.0),
        Parameter(
            'topic',
            '-',
            0.0,
            2.0,
            2.0,
            choices=(0.0, 1.0, 2.0),
            words=('samples of the motors', 'samples of the wires', 'samples of the tracker'),
        ),
    ),
    traits=Traits(audited=True, symptom=Symptom.MISSING_SAMPLES),
)


@on_samples(EFFECT)
def gap(values: Mapping[str, float], column: int) -> RecordingFaults:
    """The stretch that is missing."""
    topic = TOPICS[round(values['topic'])]
    return RecordingFaults(gaps=(Gap(topic, values['time_s'], values['duration_s']),))
