"""The rig: gears, limits, time-outs and devices, defined once for all nodes."""

from endoscope_core.rig.facts import (
    InstrumentFacts,
    Kind,
    MotorFacts,
    Rig,
    RigKind,
    digest,
    kind_from_text,
    kind_of_several,
    load_rig,
    rig_as_text,
    rig_from_text,
    shipped_rig,
)

__all__ = [
    'InstrumentFacts',
    'Kind',
    'MotorFacts',
    'Rig',
    'RigKind',
    'digest',
    'kind_from_text',
    'kind_of_several',
    'load_rig',
    'rig_as_text',
    'rig_from_text',
    'shipped_rig',
]
