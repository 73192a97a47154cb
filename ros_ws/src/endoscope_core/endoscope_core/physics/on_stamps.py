"""The plant's answer to recorded commands, at the stamps of a recording."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.packing import recording_faults
from endoscope_core.physics.simulator import TICK, PlantTrajectory, simulate

Stamps = NDArray[np.int64]
Array = NDArray[np.float64]

NANOSECONDS = 1e-9


@dataclass(frozen=True)
class AnswerStamps:
    """Stamps in ns at which the motor, the load cells and the tracker are to answer."""

    motor: Stamps
    wires: Stamps
    tracker: Stamps

    def first(self) -> int:
        """Earliest stamp of all."""
        return int(np.concatenate([self.motor, self.wires, self.tracker]).min())


@dataclass(frozen=True)
class RigReadings:
    """Noise-free readings at the stamps asked for, for J joints."""

    # Of motors, (N_motor, J).
    shaft_position: Array
    shaft_velocity: Array
    shaft_effort: Array
    tension: Array  # (N_wires, J, 2)
    bending: Array  # (N_tracker, J)


def hold_on_ticks(times: Array, values: Array, ticks: int) -> Array:
    """Commands (N, J) that each hold until the next, as the mean (M, J) over each tick from 0 s on.

    Stamps (N,) in s must not decrease. Before the first one, the first command is in force.
    """
    if np.any(np.diff(times) < 0):
        raise ValueError('the stamps of the commands decrease')
    edges = TICK * np.arange(ticks + 1)
    index = np.clip(np.searchsorted(times, edges, side='right') - 1, 0, None)
    result = values[index[:-1]]
    # Only ticks with a change inside need the integral; elsewhere the held value is exact.
    changes = times[(times > 0.0) & (times < edges[-1])]
    tick_of_change = np.searchsorted(edges, changes, side='right') - 1
    inside = changes > edges[tick_of_change]
    divided = np.unique(tick_of_change[inside])
    corners = np.sort(np.concatenate([edges[divided], edges[divided + 1], changes[inside]]))
    pieces = np.diff(corners)
    tick_of_piece = np.searchsorted(edges, corners[:-1], side='right') - 1
    # What lies between two divided ticks that are no neighbours begins in a tick that is not one.
    within = np.isin(tick_of_piece, divided)
    held = values[np.clip(np.searchsorted(times, corners[:-1], side='right') - 1, 0, None)]
    result[divided] = 0.0
    np.add.at(result, tick_of_piece[within], (pieces[:, None] * held)[within] / TICK)
    return result


def answer_commands(
    plant: PlantDescription,
    command_stamps: Stamps,
    shaft_commands: Array,
    answer_stamps: AnswerStamps,
    read_delay: float = 0.0,
) -> RigReadings:
    """What the noise-free sensors of a rig read at given stamps under recorded commands.

    The stamps are what the devices' clocks say: a plant whose tracker's clock is skewed answers
    with the angle of the time at which that clock said so. Commands (N, J) are shaft angles in rad,
    each in force from its stamp in ns, which must not decrease, until the next one. The rig rests
    at the first command. `read_delay`: s from a stamp to the reading that carries it: zero, or the
    length of a cycle where a rig stamps the cycle's beginning, sends the command and then reads.
    """
    origin = min(answer_stamps.first(), int(command_stamps[0]))
    faults = recording_faults(plant)
    answer_times = {
        'motor': _seconds(answer_stamps.motor, origin) + read_delay,
        'wires': _seconds(answer_stamps.wires, origin) + read_delay,
        'tracker': faults.tracker_time(_seconds(answer_stamps.tracker, origin)) + read_delay,
    }
    last = max(float(stretch.max(initial=0.0)) for stretch in answer_times.values())
    # One tick more than the last stamp needs, so that interpolation has a right neighbour.
    ticks = int(np.ceil(last / TICK)) + 2
    times = _seconds(command_stamps, origin)
    command = hold_on_ticks(times, shaft_commands, ticks)
    trajectory = simulate(plant, command, start_shaft=shaft_commands[0])
    answer = _at_stamps(trajectory, answer_times)
    return replace(answer, bending=faults.spoilt(answer.bending, answer_times['tracker']))


def _seconds(stamps: Stamps, origin: int) -> Array:
    return np.asarray((stamps - origin) * NANOSECONDS, dtype=np.float64)


def _at_stamps(trajectory: PlantTrajectory, times: Mapping[str, Array]) -> RigReadings:
    return RigReadings(
        _interpolate(trajectory.shaft_position, times['motor']),
        _interpolate(trajectory.shaft_velocity, times['motor']),
        _interpolate(trajectory.shaft_effort, times['motor']),
        _interpolate(trajectory.tension, times['wires']),
        _interpolate(trajectory.bending, times['tracker']),
    )


def _interpolate(rows: Array, times: Array) -> Array:
    place = times / TICK
    # Stamps on a tick, to the nanosecond, take the tick's own row.
    nearest_row = np.round(place)
    place = np.where(np.abs(place - nearest_row) < 1e-5, nearest_row, place)
    left = np.clip(place.astype(np.int64), 0, len(rows) - 2)
    share = (place - left).reshape(-1, *[1] * (rows.ndim - 1))
    return rows[left] + share * (rows[left + 1] - rows[left])
