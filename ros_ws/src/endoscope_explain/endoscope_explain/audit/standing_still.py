"""Topics that stand still while the rig moves, motors that do not follow, and held poses."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from endoscope_core.physics.description import SensorParameters
from endoscope_core.rig import Rig
from endoscope_core.safety import MotionLimits, MotionShaper
from endoscope_explain.audit.finding import Finding, Severity
from endoscope_explain.audit.misreading import column_name
from endoscope_explain.audit.stamps import find_gaps, usual_interval
from endoscope_explain.recording import MOTOR, MOVES_RAD, Array, Recording, Series

LONG_S = 1.0
SHARE = 0.5
"""Part of the recording from whose length on a topic is frozen, not held for a moment."""
NOISES = 10.0


def moves(series: Series | None) -> bool:
    """Whether any column of shaft angles moves."""
    return series is not None and bool(np.ptp(series.values, axis=0).max() >= MOVES_RAD)


def frozen_findings(
    recording: Recording,
    grid: Array,
    expected: Mapping[str, Array],
    noise: Mapping[str, float],
    noisy: bool,
) -> list[Finding]:
    """Find topics that repeat one reading to the end, or throughout, though they must move."""
    # `expected` (N, columns) is what the plant makes of the command at the grid's times (N,) in s.
    findings = []
    by_topic: dict[str, list[tuple[str, Series]]] = {}
    for quantity, series in recording.measured().items():
        by_topic.setdefault(series.topic, []).append((quantity, series))
    for held in by_topic.values():
        time = held[0][1].time
        values = np.concatenate([s.values.reshape(len(time), -1) for _, s in held], axis=1)
        found = _frozen_since(time, values)
        columns = [
            (quantity, c) for quantity, _ in held for c in range(expected[quantity].shape[1])
        ]
        # Of a recording that shows no noise, a slack wire and a joint that is held fast may well
        # give one reading.
        sure = noisy or held[0][1].topic == MOTOR
        if (
            sure
            and found is not None
            and any(must_move(expected[q][:, c], grid, found, noise[q]) for q, c in columns)
        ):
            findings.append(_finding(recording, columns, found, held[0][1].topic))
            continue
        for index, (quantity, c) in enumerate(columns):
            constant = np.ptp(values[:, index]) == 0.0
            # An encoder of a motor that is held fast stands still as well.
            if (
                constant
                and noisy
                and quantity in ('tension', 'bending')
                and must_move(expected[quantity][:, c], grid, float(time[0]), noise[quantity])
            ):
                name = column_name(recording, quantity, c)
                findings.append(_finding(recording, [(quantity, c)], float(time[0]), name))
    command = recording.command
    if not moves(command) and moves(recording.shaft_position):
        columns = [('command', j) for j in range(len(recording.joints))]
        findings.append(_finding(recording, columns, float(command.time[0]), command.topic))
    return findings


def without_frozen(recording: Recording, frozen: Sequence[Finding]) -> Recording:
    """The recording without what stood still; a motor that did is as one that was not recorded."""
    since = {signal: f.intervals[0][0] for f in frozen for signal in f.signals}
    changed: dict[str, Any] = {}
    for quantity, series in recording.measured().items():
        flat = series.values.reshape(len(series.time), -1)
        names = [column_name(recording, quantity, c) for c in range(flat.shape[1])]
        begins = np.array([since.get(name, np.inf) for name in names])
        wrong = (series.time[:, None] >= begins).reshape(series.valid.shape)
        stands = series.topic == MOTOR and wrong.any()
        changed[quantity] = None if stands else series.without(wrong)
    return replace(recording, **changed)


def resting_motor_findings(recording: Recording) -> list[Finding]:
    """Note motors that stand still although they are commanded to move."""
    if recording.shaft_position is None:
        return []
    findings = []
    for j, joint in enumerate(recording.joints):
        commanded = float(np.ptp(recording.command.values[:, j]))
        if commanded < MOVES_RAD or np.ptp(recording.shaft_position.values[:, j]) >= MOVES_RAD:
            continue
        signal = column_name(recording, 'shaft_position', j)
        findings.append(
            Finding(
                'motor_at_rest',
                Severity.NOTE,
                joint,
                'recording',
                (signal,),
                ((0.0, recording.duration),),
                f'{signal} stands still while its command moves by {commanded:.3g} rad',
                'check that the motor was enabled and free to turn',
            )
        )
    return findings


def _frozen_since(time: Array, values: Array) -> float | None:
    """When the last change was, where it is long ago."""
    change = np.flatnonzero((np.diff(values, axis=0) != 0.0).any(axis=1))
    since = float(time[change[-1] + 1] if len(change) else time[0])
    long = max(LONG_S, SHARE * float(time[-1] - time[0]))
    return since if float(time[-1]) - since >= long else None


def must_move(expected: Array, grid: Array, since: float, noise: float) -> bool:
    """Whether an expected signal (N,) moves by more than its noise, in its own unit."""
    later = expected[grid >= since]
    return len(later) > 1 and bool(np.ptp(later) > max(NOISES * noise, MOVES_RAD))


def _finding(
    recording: Recording, columns: list[tuple[str, int]], since: float, what: str
) -> Finding:
    quantity, column = columns[0]
    per_joint = 2 if quantity == 'tension' else 1
    meanwhile = 'the command moves' if quantity != 'command' else 'the motors move'
    return Finding(
        'frozen',
        Severity.MISTAKE,
        recording.joints[column // per_joint],
        'recording',
        tuple(column_name(recording, q, c) for q, c in columns),
        ((since, recording.duration),),
        f'{what} is frozen: it repeats one reading from {since:.3f} s to its end while {meanwhile}',
        'record it again with its source running',
    )


# A motor driver that hears nothing any more holds the shafts where they are at that moment, which
# is short of the last command if they were on their way. What was commanded then is in no topic.

_THERE_RAD = 1e-6


def with_held_poses(
    recording: Recording, sensors: SensorParameters, findings: list[Finding]
) -> Recording:
    """Command the poses that the motors were held at while no commands came, and note it."""
    command, shaft = recording.command, recording.shaft_position
    if shaft is None or len(command.time) < 2:
        return recording
    count = 2.0 * np.pi / sensors.encoder_counts
    found = []
    for begin, end in find_gaps(command, float(command.time[0]), recording.duration):
        last = command.values[np.searchsorted(command.time, begin)]
        pose = _held_pose(shaft, begin, end, last, count, recording.rig)
        if pose is not None:
            found.append(pose)
    if not found:
        return recording
    findings.append(
        Finding(
            'held_pose',
            Severity.NOTE,
            recording.joints[0],
            'recording',
            (command.topic,),
            tuple((at, at) for at, _ in found),
            f'{command.topic} paused in mid-motion, and the motors held where they were '
            f'({len(found)} times, first at {found[0][0]:.3f} s)',
            'the poses that were held are taken for commands',
            evidence={'count': float(len(found))},
        )
    )
    beat = usual_interval(shaft.time)
    ways = [_way(command, *p, beat, recording.rig) for p in found]
    return replace(recording, command=_with_ways(command, ways))


def _held_pose(
    shaft: Series, begin: float, end: float, last: Array, count: float, rig: Rig
) -> tuple[float, Array] | None:
    """When the shafts were told to hold, and where; None if they went to the last command."""
    given_up = begin + rig.timeouts.command
    if end <= given_up:
        return None
    inside = (shaft.time >= begin) & (shaft.time < end) & shaft.valid.all(axis=1)
    time, angle = shaft.time[inside], shaft.values[inside]
    resting = angle[time >= 0.5 * (begin + end)]
    if len(resting) < 2 or np.ptp(resting, axis=0).max() > 1.5 * count:
        return None
    rest = np.median(resting, axis=0)
    if np.abs(rest - last).max() <= 1.5 * count:
        return None
    beat = usual_interval(shaft.time)
    # A pose is held if the shafts end at it although they were sent on, and if they came by it no
    # later than the driver gives a stream up: as a rule at that very moment.
    there = (np.abs(angle - rest) < 1.5 * count).all(axis=1) & (time <= given_up + 2.0 * beat)
    if not there.any():
        return None
    by = float(time[there][0])
    return (given_up if (there & (time >= given_up - 2.0 * beat)).any() else by), rest


def _way(command: Series, at: float, pose: Array, beat: float, rig: Rig) -> tuple[Array, Array]:
    """Goals on the way from the last command to a pose, at each beat of the driver."""
    motors = rig.motors
    last = command.values[np.searchsorted(command.time, at) - 1]
    reach = max(motors.reach, float(np.abs([last, pose]).max()))
    limits = (reach, motors.speed, motors.acceleration, motors.step)
    shaper = MotionShaper(MotionLimits.either_way(len(pose), *limits))
    shaper.restart(last.tolist())
    goals = [np.array(shaper.shape(pose.tolist(), beat))]
    while np.abs(goals[-1] - pose).max() > _THERE_RAD:
        goals.append(np.array(shaper.shape(pose.tolist(), beat)))
    goals[-1] = pose
    times = np.asarray(at + beat * np.arange(len(goals)), dtype=np.float64)
    return times, np.stack(goals)


def _with_ways(command: Series, ways: Sequence[tuple[Array, Array]]) -> Series:
    at = np.concatenate([time for time, _ in ways])
    place = np.searchsorted(command.time, at, side='right')
    values = np.insert(command.values, place, np.concatenate([goals for _, goals in ways]), axis=0)
    received = command.received
    if received is not None:
        # Heard as long after their stamps as the commands before them.
        delay = received[place - 1] - command.time[place - 1]
        received = np.insert(received, place, at + delay)
    time = np.insert(command.time, place, at)
    return Series.of(command.topic, time, values, received)
