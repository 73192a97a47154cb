"""What a plant's effects do to its recordings, beside what they do to the rig."""

import functools

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.effects import describe
from endoscope_core.physics.hooks import ON_SAMPLES
from endoscope_core.physics.packing import effect_values
from endoscope_core.physics.samples import RecordingFaults


def recording_faults(plant: PlantDescription) -> RecordingFaults:
    """The faults that a plant's effects give to its recordings.

    Raises
    ------
    ValueError
        If an effect is invalid, or its joints disagree about the tracker's one clock.
    """
    joints = plant.joint_names()
    parts = []
    for spec in plant.effects:
        effect, values = describe(spec.id), effect_values(spec)
        if spec.id in ON_SAMPLES:
            named = {p.name: float(v) for p, v in zip(effect.parameters, values, strict=True)}
            parts.append(ON_SAMPLES[spec.id](named, joints.index(spec.joint)))
    return functools.reduce(RecordingFaults.joined, parts, RecordingFaults())
