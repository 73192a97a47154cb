"""The rig: gears, limits, time-outs and devices, defined once for all nodes."""

from endoscope_core.rig.facts import (
    DeviceFacts,
    HandleFacts,
    InstrumentFacts,
    JointFacts,
    MotorFacts,
    Rig,
    SimulationFacts,
    Timeouts,
    TipFacts,
    load_rig,
    rig_as_text,
    rig_from_text,
    shipped_rig,
)
from endoscope_core.rig.kind import Kind, RigKind, digest, kind_from_text, kind_of_several

__all__ = [
    'DeviceFacts',
    'HandleFacts',
    'InstrumentFacts',
    'JointFacts',
    'Kind',
    'MotorFacts',
    'Rig',
    'RigKind',
    'SimulationFacts',
    'Timeouts',
    'TipFacts',
    'digest',
    'kind_from_text',
    'kind_of_several',
    'load_rig',
    'rig_as_text',
    'rig_from_text',
    'shipped_rig',
]
