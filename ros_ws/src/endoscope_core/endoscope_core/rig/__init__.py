"""What stands on the table: gears, limits, time-outs and devices, said once for every node."""

from endoscope_core.choices import LOAD_CELL_DEVICES, MOTOR_DEVICES, TRACKER_DEVICES
from endoscope_core.rig.facts import (
    DeviceFacts,
    HandleFacts,
    InstrumentFacts,
    JointFacts,
    MotorFacts,
    RecordingFacts,
    Rig,
    SimulationFacts,
    Timeouts,
    load_rig,
    rig_as_text,
    rig_from_text,
    shipped_rig,
)

__all__ = [
    'LOAD_CELL_DEVICES',
    'MOTOR_DEVICES',
    'TRACKER_DEVICES',
    'DeviceFacts',
    'HandleFacts',
    'InstrumentFacts',
    'JointFacts',
    'MotorFacts',
    'RecordingFacts',
    'Rig',
    'SimulationFacts',
    'Timeouts',
    'load_rig',
    'rig_as_text',
    'rig_from_text',
    'shipped_rig',
]
