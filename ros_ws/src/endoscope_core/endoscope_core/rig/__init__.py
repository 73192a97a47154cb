"""What stands on the table: gears, limits and time-outs, said once for every node."""

from endoscope_core.rig.facts import (
    HandleFacts,
    JointFacts,
    MotorFacts,
    Rig,
    RigFileError,
    Timeouts,
    load_rig,
    shipped_rig,
)

__all__ = [
    'HandleFacts',
    'JointFacts',
    'MotorFacts',
    'Rig',
    'RigFileError',
    'Timeouts',
    'load_rig',
    'shipped_rig',
]
