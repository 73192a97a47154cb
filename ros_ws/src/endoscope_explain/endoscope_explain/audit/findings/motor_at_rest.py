"""Motors that stand still although they are commanded to move."""

import numpy as np

from endoscope_explain.audit.examined import Examined
from endoscope_explain.audit.finding import FindingKind, Severity
from endoscope_explain.recording import MOVES_RAD

KIND = FindingKind(
    'motor_at_rest',
    Severity.NOTE,
    '{signals} stands still while its command moves by {commanded:.3g} rad',
    'check that the motor was enabled and free to turn',
)


def find(seen: Examined) -> Examined:
    """Note the motors."""
    recording, shaft = seen.recording, seen.recording.shaft_position
    if shaft is None:
        return seen
    moved = np.ptp(shaft.values, axis=0)
    commanded = np.ptp(recording.command.values, axis=0)
    found = [
        KIND.found(recording, [('shaft_position', j)], commanded=to)
        for j, (by, to) in enumerate(zip(moved, commanded, strict=True))
        if by < MOVES_RAD <= to
    ]
    return seen.found(*found)
