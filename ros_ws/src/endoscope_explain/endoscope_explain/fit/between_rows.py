"""What a command did between the rows of a table that is slower than the motors.

A bag of the graph has every command, and each holds until the next one. A table of a hundred rows a
second may be taken from a stream that is ten times as fast: held from row to row, its command comes
half a row late and in steps, which looks like a servo that errs.
"""

from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.simulator import TICK
from endoscope_explain.fit.evidence import log_evidence
from endoscope_explain.fit.model import packed_joint
from endoscope_explain.fit.nominal import nominal_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.recording import MOVES_RAD, RigRecording, Series

SLOW_S = 2.0 * TICK
"""Time from one command to the next, in the middle, from which on it may have moved between."""
GAP = 5.0
"""Times as long a pause is one in which the command was held."""


def with_command_between_rows(recording: RigRecording, plant: PlantDescription) -> RigRecording:
    """The recording with its command straight between rows, where the rig follows that better.

    The nominal plant is refitted to both, and their evidence decides.
    """
    command = recording.command
    apart = float(np.median(np.diff(command.time))) if len(command.time) > 1 else 0.0
    if apart <= SLOW_S or float(np.max(np.ptp(command.values, axis=0))) < MOVES_RAD:
        return recording
    straight = replace(recording, command=_straight(command, GAP * apart))
    held, followed = (_evidence(each, plant) for each in (recording, straight))
    if followed <= held:
        return recording
    note = (
        f'the command goes straight between its rows, {1e3 * apart:.1f} ms apart: by '
        f'{followed - held:.0f} nats the rig follows that, and not a command that is held'
    )
    return replace(straight, notes=(*recording.notes, note))


def _straight(command: Series, gap: float) -> Series:
    """A command on ticks that goes straight from row to row, but over a gap."""
    begin = float(command.time[0])
    time = begin + TICK * np.arange(round((float(command.time[-1]) - begin) / TICK) + 1)
    last = np.searchsorted(command.time, time, side='right') - 1
    pauses = np.append(np.diff(command.time) > gap, True)[last]
    values = np.column_stack([np.interp(time, command.time, v) for v in command.values.T])
    values = np.where(pauses[:, None], command.values[last], values)
    return Series.of(command.topic, np.asarray(time, np.float64), values)


def _evidence(recording: RigRecording, plant: PlantDescription) -> float:
    """Logarithm of the evidence of the nominal plant, refitted."""
    with threadpool_limits(1, 'blas'):
        seen = [each for each in observe(recording, plant) if each.channels]
        fits = (nominal_references(o, *packed_joint(plant, o.joint))[0] for o in seen)
        return sum(map(log_evidence, fits))
