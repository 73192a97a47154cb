"""Recordings of a rig's tubes as text files, one tube each, of two cycles or more of one sine."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from endoscope_core.identification.family_fit import TubeRecording
from endoscope_core.identification.hysteresis_fit import IdentificationError

CYCLE_S = 2.0 * np.pi
"""Seconds of one cycle, and its phase: the motion is a sine of 1 rad/s."""
ROW_S = 5.0e-3
"""Seconds between rows. The phase column counts loops and is no clock."""
PHASE, DESIRED, ACTUAL, POSITIVE, NEGATIVE = 0, 1, 3, 4, 5
"""Columns: phase in rad, desired and actual angle in deg, tension of both wires in N."""


def tube_recordings(folder: Path) -> list[TubeRecording]:
    """Two cycles in real time of each tube of a folder, from its `BEND.txt` (deg), by bend."""
    found = []
    for path in folder.glob('[0-9]*.txt'):
        table = np.loadtxt(path, delimiter=',')
        cycles = np.searchsorted(table[:, PHASE], (0.0, CYCLE_S, 2.0 * CYCLE_S)).tolist()
        if table[-1, PHASE] < 2.0 * CYCLE_S or cycles[0] != 0:
            raise IdentificationError(f'{path}: fewer than two whole cycles')
        found.append(
            TubeRecording(
                float(np.deg2rad(float(path.stem))),
                ROW_S,
                np.deg2rad(table[:, DESIRED]),
                np.deg2rad(table[:, ACTUAL]),
                table[:, [POSITIVE, NEGATIVE]],
                tuple(cycles),
            )
        )
    if not found:
        raise IdentificationError(f'{folder}: no recordings of tubes (files such as 60.txt)')
    return sorted(found, key=lambda recording: recording.bend)
